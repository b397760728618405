// The twin as it is drawn: links, collision pieces, axes; and where its joints are.
import * as THREE from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";

const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;

// Joint values with those of followers put in: a sum of powers of the leader's.
export function followed(twin, values) {
  const q = [...values];
  for (const c of twin.tree.couplings ?? []) {
    q[c.follower] = c.polynomial.reduce((sum, k, n) => sum + k * q[c.leader] ** n, 0);
  }
  return q;
}

export async function load(twin, glb) {
  const gltf = await new GLTFLoader().parseAsync(bytes(glb), "");
  const nodes = [];
  gltf.scene.traverse((o) => {
    const { nodes: index } = gltf.parser.associations.get(o) ?? {};
    // A node and its mesh answer to one number; the outer one comes first.
    if (index !== undefined && index < twin.parts.length) nodes[index] ??= o;
  });
  nodes.forEach((node, part) => (node.userData.part = part));
  const rest = nodes.map((n) => n.position.clone());
  const joints = twin.tree.joints.map((j) => ({
    ...j,
    turns: j.screw.kind !== "prismatic" && j.screw.kind !== "fixed",
    slides: j.screw.kind === "prismatic",
    direction: new THREE.Vector3(...j.screw.axis),
  }));
  const scene = new THREE.Scene();
  scene.add(gltf.scene);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8a8a, 2.6));
  const sun = new THREE.DirectionalLight(0xffffff, 1.2);
  sun.position.set(1, 2, 1.5);
  scene.add(sun);
  const hulls = collision(twin, nodes);
  const axes = lines(twin, joints, nodes);
  // Values of all joints, radians and units, as the links then stand.
  const pose = (values) => {
    const q = followed(twin, values);
    joints.forEach((j, k) => {
      const node = nodes[j.child];
      if (j.turns) node.quaternion.setFromAxisAngle(j.direction, q[k]);
      if (j.slides) node.position.copy(rest[j.child]).addScaledVector(j.direction, q[k]);
    });
    scene.updateMatrixWorld(true);
    return q;
  };
  pose(joints.map(() => 0));
  return { scene, nodes, joints, hulls, axes, pose, box: new THREE.Box3().setFromObject(gltf.scene) };
}

// Corners and triangles of an OBJ that has nothing else.
function obj(text) {
  const vertices = [];
  const faces = [];
  for (const line of text.split("\n")) {
    const [kind, ...rest] = line.split(/\s+/);
    if (kind === "v") vertices.push(...rest.slice(0, 3).map(Number));
    if (kind === "f") faces.push(...rest.slice(0, 3).map((corner) => parseInt(corner, 10) - 1));
  }
  return { vertices, faces };
}

// The pieces of each part, in its link's frame.
function collision(twin, nodes) {
  return twin.collision.map((pieces, part) => {
    const group = new THREE.Group();
    group.visible = false;
    pieces.map(obj).forEach((piece, k) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.Float32BufferAttribute(piece.vertices, 3));
      geometry.setIndex(piece.faces);
      const color = new THREE.Color().setHSL((k * 0.381966) % 1, 0.6, 0.6);
      const flat = geometry.toNonIndexed();
      flat.computeVertexNormals();
      group.add(new THREE.Mesh(flat, new THREE.MeshLambertMaterial({ color })));
    });
    nodes[part].add(group);
    return group;
  });
}

// Each joint's axis through its link's origin, in the frame of what carries it.
function lines(twin, joints, nodes) {
  return joints.map((j) => {
    const far = j.direction.clone().multiplyScalar(0.6 * twin.diagonal);
    const geometry = new THREE.BufferGeometry().setFromPoints([far.clone().negate(), far]);
    const line = new THREE.Line(geometry, new THREE.LineBasicMaterial({ color: 0xd9480f, depthTest: false }));
    line.renderOrder = 1;
    line.visible = false;
    // Turning about itself, or sliding along itself, an axis stays where it is.
    nodes[j.child].add(line);
    return line;
  });
}
