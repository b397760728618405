// A part follows the pointer along the way that its joint leaves it.
import * as THREE from "three";

// The part that a pointer at (x, y), -1 to 1, is on, and where.
export function grasp(view, camera, x, y) {
  const ray = new THREE.Raycaster();
  ray.setFromCamera(new THREE.Vector2(x, y), camera);
  const shown = (o) => o.visible && (!o.parent || shown(o.parent));
  const hit = ray.intersectObject(view.scene, true).find((h) => h.object.isMesh && shown(h.object));
  if (!hit) return null;
  let node = hit.object;
  while (node && node.userData.part === undefined) node = node.parent;
  if (!node) return null;
  const part = node.userData.part;
  return { part, joint: mover(view, part), local: view.nodes[part].worldToLocal(hit.point.clone()) };
}

// The nearest joint, from a part to the root, that moves.
function mover(view, part) {
  for (let at = part; ; ) {
    const joint = view.joints.findIndex((j) => j.child === at);
    if (joint < 0) return -1;
    if (view.joints[joint].turns || view.joints[joint].slides) return joint;
    at = view.joints[joint].parent;
  }
}

// The change of a joint's value that brings the held point nearest to the pointer (one Gauss-Newton step
// in pixels). Values as `values`, pointer and size in pixels.
export function step(view, camera, held, values, pointer, size) {
  const pixel = (q) => {
    view.pose(q);
    const p = view.nodes[held.part].localToWorld(held.local.clone()).project(camera);
    return new THREE.Vector2(((p.x + 1) / 2) * size.x, ((1 - p.y) / 2) * size.y);
  };
  const by = view.joints[held.joint].turns ? 1e-3 : 1e-3 * view.diagonal;
  const now = pixel(values);
  const moved = [...values];
  moved[held.joint] += by;
  const slope = pixel(moved).sub(now).divideScalar(by);
  const most = view.joints[held.joint].turns ? 0.3 : 0.2 * view.diagonal;
  const square = slope.lengthSq();
  // Seen along its way, a part does not know where the pointer wants it.
  const firm = (8 / (view.joints[held.joint].turns ? 1 : view.diagonal)) ** 2;
  const change = pointer.clone().sub(now).dot(slope) / (square + firm);
  return Math.max(-most, Math.min(most, change));
}
