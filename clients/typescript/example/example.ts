/**
 * Mends a scan and pulls the middle of its first hole, in a page of your own with plain three.js.
 *
 *   node web/build.mjs example OUT      bundles it; then serve OUT from any origin that darn allows (--allow-origin)
 *
 * `?service=URL` names the service; without it the page's own origin is asked.
 */
import {
  BufferAttribute,
  BufferGeometry,
  DirectionalLight,
  DoubleSide,
  HemisphereLight,
  Mesh,
  MeshStandardMaterial,
  PerspectiveCamera,
  Scene,
  Vector3,
  WebGLRenderer,
} from 'three';
import { type Constraints, type HolePositions, ClothSession, Service, describeError } from '../src/index.js';

const service = new Service(new URL(new URLSearchParams(location.search).get('service') ?? '/', location.href));
const [file, pull, said] = ['scan', 'pull', 'said'].map((id) => document.getElementById(id)) as [
  HTMLInputElement,
  HTMLInputElement,
  HTMLOutputElement,
];

const renderer = new WebGLRenderer({ canvas: document.getElementById('view') as HTMLCanvasElement, antialias: true });
renderer.setSize(innerWidth, innerHeight);
const [scene, camera] = [new Scene(), new PerspectiveCamera(40, innerWidth / innerHeight, 0.001, 1000)];
scene.add(new HemisphereLight(0xffffff, 0x777777, 2), new DirectionalLight(0xffffff, 2));
const material = new MeshStandardMaterial({ color: 0xc9772e, side: DoubleSide });
const cloths = new Map<number, Mesh>();
let session: ClothSession | undefined;

/** Moves the new cloth to where the service says. The triangles never change. */
function show(patches: HolePositions[]): void {
  for (const { hole, positions } of patches) {
    let cloth = cloths.get(hole.id ?? 0);
    if (cloth === undefined) {
      cloth = new Mesh(new BufferGeometry(), material);
      cloth.geometry.setIndex([...(hole.patchFaces ?? [])]);
      cloths.set(hole.id ?? 0, cloth);
      scene.add(cloth);
    }
    cloth.geometry.setAttribute('position', new BufferAttribute(positions, 3));
    cloth.geometry.computeVertexNormals();
  }
  renderer.render(scene, camera);
}

/** Looks at the new cloth, along its mean normal. */
function frame({ positions }: HolePositions): void {
  const cloth = [...cloths.values()][0];
  cloth?.geometry.computeBoundingSphere();
  const sphere = cloth?.geometry.boundingSphere;
  const normals = cloth?.geometry.getAttribute('normal');
  if (sphere && normals) {
    const mean = new Vector3();
    for (let k = 0; 3 * k < positions.length; k += 1) {
      mean.add(new Vector3().fromBufferAttribute(normals, k));
    }
    camera.position.copy(sphere.center).addScaledVector(mean.normalize(), 4 * sphere.radius);
    camera.lookAt(sphere.center);
  }
}

/** A grab in the middle of the first hole's chart, along its normal. */
function grab(): Constraints {
  const hole = session?.holes[0];
  const cloth = cloths.get(hole?.id ?? 0);
  const [positions, normals] = ['position', 'normal'].map((name) => cloth?.geometry.getAttribute(name));
  const middle = middleOf(hole?.patchUvs ?? []);
  if (hole === undefined || positions === undefined || normals === undefined || middle === undefined) {
    return {};
  }
  const length = (cloth?.geometry.boundingSphere?.radius ?? 0) * 0.5 * pull.valueAsNumber;
  const normal = new Vector3().fromBufferAttribute(normals, middle.vertex);
  return {
    edits: [{ hole: hole.id ?? 0, grab: { uv: middle.uv, offset: normal.multiplyScalar(length).toArray() } }],
  };
}

/** The patch vertex nearest to the middle of all. */
function middleOf(uvs: readonly number[]): { vertex: number; uv: [number, number] } | undefined {
  const points = Array.from({ length: uvs.length / 2 }, (_, k) => [uvs[2 * k] ?? 0, uvs[2 * k + 1] ?? 0] as const);
  const mean = [0, 1].map((axis) => points.reduce((sum, p) => sum + (p[axis as 0 | 1] ?? 0), 0) / points.length);
  const away = points.map(([u, v]) => Math.hypot(u - (mean[0] ?? 0), v - (mean[1] ?? 0)));
  const vertex = away.indexOf(Math.min(...away));
  const point = points[vertex];
  return point && { vertex, uv: [point[0], point[1]] };
}

file.addEventListener('change', () => void mendChosen());

async function mendChosen(): Promise<void> {
  const scan = file.files?.[0];
  if (scan === undefined) {
    return;
  }
  try {
    session?.close();
    cloths.forEach((cloth) => scene.remove(cloth));
    cloths.clear();
    session = await ClothSession.open(service, scan, {}, { onSent: (share) => (said.value = `${share * 100} % sent`) });
    const { patches, report } = await session.mend({});
    show(patches);
    if (patches[0] !== undefined) {
      frame(patches[0]);
    }
    show(patches);
    said.value = `${report.holes?.length ?? 0} filled`;
    pull.disabled = false;
  } catch (error) {
    said.value = describeError(error);
  }
}

pull.addEventListener('input', () => {
  session?.drag(grab(), { onPatches: show, onError: (error) => (said.value = describeError(error)) });
});
