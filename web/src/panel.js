// Sliders, states, what is shown, doubts.
const make = (tag, props = {}, ...children) => {
  const e = Object.assign(document.createElement(tag), props);
  e.append(...children);
  return e;
};
const degrees = (x) => (x * 180) / Math.PI;

// Digits of a number; none of them make a minus zero.
const fixed = (x, digits) => x.toFixed(digits).replace(/^-(0\.?0*)$/, "$1");

// A joint's value in words.
export function words(joint, value, metric) {
  if (joint.turns) return `${fixed(degrees(value), 1)}°`;
  return metric ? `${fixed(1000 * value, 1)} mm` : fixed(value, 4);
}

// How sure its axis is, or nothing: two standard deviations.
function sure(certainty) {
  return certainty ? `axis ± ${(2 * certainty.axis_deg).toPrecision(1)}°` : "";
}

export function panel(at, twin, joints, act) {
  const rows = joints.map((joint, k) => {
    if (!joint.turns && !joint.slides) return null;
    const led = (twin.tree.couplings ?? []).find((c) => c.follower === k);
    const [low, high] = joint.screw.kind === "continuous" ? [-Math.PI, Math.PI] : joint.limits;
    const slider = make("input", { type: "range", min: low, max: high, step: "any", disabled: !!led });
    slider.setAttribute("aria-label", joint.name);
    slider.oninput = () => act.set(k, Number(slider.value));
    const shown = make("output");
    const ends = [low, high].map((x) => words(joint, x, twin.metric));
    const note = led ? `follows ${joints[led.leader].name}` : sure(twin.certainty?.[k]);
    const range = make("small", {}, make("span", { textContent: ends[0] }), note, make("span", { textContent: ends[1] }));
    const row = make("div", { className: "joint" }, make("b", { textContent: joint.name }), shown, slider, range);
    at.append(row);
    return { slider, shown, row };
  });
  const title = make("h1", { textContent: twin.name });
  const counts = `${twin.parts.length} parts, ${rows.filter(Boolean).length} joints that move`;
  at.prepend(title, make("p", { className: "faint", textContent: counts }), make("h2", { textContent: "Joints" }));
  const states = joints.length ? joints[0].values.length : 0;
  if (states) {
    at.append(make("h2", { textContent: "States of the recording" }));
    for (let s = 0; s < states; s++) at.append(make("button", { textContent: s, onclick: () => act.state(s) }));
  }
  at.append(make("h2", { textContent: "Shown" }));
  for (const what of ["surface", "collision", "axes"]) {
    const button = make("button", { textContent: what });
    const press = (on) => button.setAttribute("aria-pressed", on);
    press(what === "surface");
    button.onclick = () => press(act.toggle(what));
    at.append(button);
  }
  at.append(make("button", { textContent: "whole", title: "the camera back to where it began", onclick: act.home }));
  at.append(make("h2", { textContent: "Doubts" }));
  const doubts = twin.doubts.map((text) => make("li", { textContent: text }));
  at.append(doubts.length ? make("ul", {}, ...doubts) : make("p", { className: "faint", textContent: "none" }));
  const help = "Drag a part along its way, anything else to look around; wheel or two fingers to come nearer.";
  at.append(make("h2", { textContent: "How" }), make("p", { className: "faint", textContent: help }));
  return {
    show(q, held) {
      rows.forEach((r, k) => {
        if (!r) return;
        r.slider.value = q[k];
        r.shown.textContent = words(joints[k], q[k], twin.metric);
        r.row.classList.toggle("held", k === held);
      });
    },
  };
}
