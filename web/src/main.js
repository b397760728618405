import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { grasp, step } from "./drag.js";
import { panel } from "./panel.js";
import { load } from "./scene.js";

const text = (id) => document.getElementById(id).textContent;

async function start() {
  const twin = JSON.parse(text("twin"));
  const view = await load(twin, text("glb").trim());
  view.diagonal = twin.diagonal;
  const place = document.getElementById("view");
  const renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  place.append(renderer.domElement);
  const camera = new THREE.PerspectiveCamera(40, 1, 0.01 * twin.diagonal, 100 * twin.diagonal);
  const orbit = new OrbitControls(camera, renderer.domElement);

  let q = view.joints.map(() => 0);
  let held = null;
  // Once a frame, however often it is asked for.
  let asked = false;
  const draw = () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      renderer.render(view.scene, camera);
    });
  };
  const side = panel(document.getElementById("panel"), twin, view.joints, {
    set: (k, value) => move(k, value),
    state: (s) => all(view.joints.map((j) => j.values[s])),
    toggle(what) {
      const on = (objects) => objects.map((o) => (o.visible = !o.visible)).at(-1) ?? false;
      const shown = what === "axes" ? on(view.axes) : what === "collision" ? on(view.hulls) : on(surfaces);
      draw();
      return shown;
    },
    home,
  });
  const surfaces = [];
  view.nodes.forEach((node) => {
    const own = (o) => {
      // The mesh may be the link itself, which others hang on: its material hides, not it.
      if (o.isMesh) surfaces.push(o.material);
      o.children.filter((c) => c.userData.part === undefined && !view.hulls.includes(c)).forEach(own);
    };
    own(node);
  });

  function all(values) {
    q = view.pose(values);
    side.show(q, held?.joint);
    draw();
  }
  function move(k, value) {
    const j = view.joints[k];
    const [low, high] = j.screw.kind === "continuous" ? [-Infinity, Infinity] : j.limits;
    all(q.map((x, i) => (i === k ? Math.max(low, Math.min(high, value)) : x)));
  }
  function home() {
    const middle = view.box.getCenter(new THREE.Vector3());
    const far = view.box.getSize(new THREE.Vector3()).length() * 1.5;
    camera.position.copy(middle).add(new THREE.Vector3(...twin.front).multiplyScalar(far));
    orbit.target.copy(middle);
    orbit.update();
    draw();
  }
  function size() {
    const { clientWidth: w, clientHeight: h } = place;
    renderer.setSize(w, h);
    camera.aspect = w / Math.max(h, 1);
    camera.updateProjectionMatrix();
    draw();
  }

  const canvas = renderer.domElement;
  const where = (e) => {
    const box = canvas.getBoundingClientRect();
    return { pixel: new THREE.Vector2(e.clientX - box.left, e.clientY - box.top), size: new THREE.Vector2(box.width, box.height) };
  };
  // Before the orbit's own listener: what takes a part does not turn the camera.
  place.addEventListener("pointerdown", (e) => {
    if (e.button !== 0 || held) return;
    const { pixel, size } = where(e);
    const found = grasp(view, camera, (2 * pixel.x) / size.x - 1, 1 - (2 * pixel.y) / size.y);
    const led = found && (twin.tree.couplings ?? []).find((c) => c.follower === found.joint);
    if (led) found.joint = led.leader;
    if (!found || found.joint < 0) return;
    held = { ...found, pointer: e.pointerId };
    orbit.enabled = false;
    side.show(q, held.joint);
  }, true);
  window.addEventListener("pointermove", (e) => {
    if (!held || e.pointerId !== held.pointer) return;
    const { pixel, size } = where(e);
    for (let round = 0; round < 4; round++) {
      move(held.joint, q[held.joint] + step(view, camera, held, q, pixel, size));
    }
  });
  const release = (e) => {
    if (!held || e.pointerId !== held.pointer) return;
    held = null;
    orbit.enabled = true;
    side.show(q);
  };
  window.addEventListener("pointerup", release);
  window.addEventListener("pointercancel", release);
  orbit.addEventListener("change", draw);
  window.addEventListener("resize", size);
  size();
  home();
  all(q);
  // For tests: values, and where a point of a link (its frame) is drawn, pixels of the canvas.
  window.hingecast = {
    get values() { return q; },
    set: move,
    pixel(part, point) {
      camera.updateMatrixWorld();
      const p = view.nodes[part].localToWorld(new THREE.Vector3(...point)).project(camera);
      return [((p.x + 1) / 2) * place.clientWidth, ((1 - p.y) / 2) * place.clientHeight];
    },
    // Columns of the matrix that takes points of the canonical world to clip space.
    get camera() {
      const m = new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
      return m.multiply(view.nodes[0].parent.matrixWorld).elements;
    },
  };
}

start().catch((error) => {
  const trouble = document.getElementById("trouble");
  trouble.textContent = `The twin cannot be drawn: ${error.message}`;
  trouble.hidden = false;
});
