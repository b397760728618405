// Bundles src/ into the one file that `hingecast view` fills: ../crates/hingecast/src/view/page.html.
import { build } from "esbuild";
import { createHash } from "node:crypto";
import { readFileSync, writeFileSync } from "node:fs";

const sources = ["src/main.js", "src/scene.js", "src/drag.js", "src/panel.js", "src/page.html", "src/page.css"];
const sum = createHash("sha256");
// What the page was made of: `cargo test` compares it with the files.
for (const file of [...sources, "package-lock.json"]) sum.update(readFileSync(file));
const built = await build({
  entryPoints: ["src/main.js"],
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2020",
  charset: "ascii",
  legalComments: "inline",
  write: false,
});
const script = built.outputFiles[0].text.replaceAll("</script", "<\\/script");
const put = (page, mark, text) => page.replace(mark, () => text);
let page = readFileSync("src/page.html", "utf8");
page = put(page, "/*CSS*/", readFileSync("src/page.css", "utf8"));
page = put(page, "/*SUM*/", sum.digest("hex"));
page = put(page, "/*SCRIPT*/", script);
writeFileSync("../crates/hingecast/src/view/page.html", page);
console.log(`page.html: ${(page.length / 1e6).toFixed(2)} MB`);
