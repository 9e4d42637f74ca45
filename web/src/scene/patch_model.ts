/** The new cloth of one hole as three.js shows it: its surface follows the patch's positions, and a hit on it has a uv. */
import type { Uv } from '../client.js';
import { type ClothPoint, hasChart, locate } from '../model/cloth.js';
import type { PlainColour } from '../model/gltf_document.js';
import type { Patch } from '../model/scan_session.js';
import {
  BufferAttribute,
  type BufferGeometry,
  Color,
  DoubleSide,
  GLTFLoader,
  type Intersection,
  type Material,
  Mesh,
  MeshStandardMaterial,
  type Texture,
  Triangle,
  Vector3,
} from '../vendor.js';
import { type VertexNumbers, vertexNumbers } from './curvature.js';
import { patchDeviations } from './deviations.js';
import { type Heat, type HeatScale, heatColors } from './heat_colors.js';
import { vectors } from './scan_model.js';
import { patchStretch } from './stretch.js';

/** The surface of a patch, and the image of its own if it has one. */
export interface Surface {
  readonly geometry: BufferGeometry;
  readonly image: Texture | null;
}

/** The surfaces of a dressing's GLB, in order of hole id. */
export async function readSurfaces(glb: ArrayBuffer): Promise<Surface[]> {
  const { scene } = await new GLTFLoader().parseAsync(glb, '');
  scene.updateMatrixWorld(true);
  const surfaces: Surface[] = [];
  scene.traverse((object) => {
    if (object instanceof Mesh) {
      surfaces.push({
        geometry: (object.geometry as BufferGeometry).applyMatrix4(object.matrixWorld),
        image: (object.material as MeshStandardMaterial).map,
      });
    }
  });
  return surfaces;
}

/** A patch's mesh. */
export class PatchModel {
  readonly mesh: Mesh<BufferGeometry, Material>;
  /** The image of the patch's own, if it has one. */
  readonly image: Texture | null;
  private readonly corners: Uint32Array;
  private readonly rim: number;
  /** The normals of the first state: those at the rim agree with the scan's and stay. */
  private readonly firstNormals: Float32Array;
  /** Colours of the corners that belong to the cloth, as a scan has them at its vertices. */
  private readonly ownColors: BufferAttribute | undefined;
  /** Of each corner: -1 where the surface shows the other side there. */
  private readonly sides: Float32Array;

  /**
   * @param patch - Its present positions, and its hole.
   * @param surface - From the dressing; this object owns it from now on.
   */
  constructor(
    private patch: Patch,
    { geometry: surface, image }: Surface,
    material: Material,
  ) {
    this.image = image;
    const id = patch.hole.id ?? 0;
    const first = patch.dressing.positions.get(id) ?? patch.positions;
    const position = surface.getAttribute('position');
    this.rim = (patch.hole.rimPositions?.length ?? 0) / 3;
    this.corners = cornerTable(position.array as Float32Array, first);
    this.firstNormals = new Float32Array(surface.getAttribute('normal').array);
    const normals = vertexNormals(first, patch.hole.patchFaces ?? []);
    this.sides = Float32Array.from(this.corners, (vertex, corner) => {
      const dot = [0, 1, 2].reduce(
        (sum, axis) => sum + (normals[3 * vertex + axis] ?? 0) * (this.firstNormals[3 * corner + axis] ?? 0),
        0,
      );
      return dot < 0 ? -1 : 1;
    });
    this.ownColors = image === null ? ownColors(patch, this.corners.length) : undefined;
    surface.setAttribute('position', vectors(new Float32Array(3 * this.corners.length)));
    surface.setAttribute('normal', vectors(new Float32Array(3 * this.corners.length)));
    this.mesh = new Mesh(surface, material);
    this.mesh.name = `hole ${id}`;
    this.unpaint();
    this.update(patch);
  }

  get hole(): number {
    return this.patch.hole.id ?? 0;
  }

  /** The patch that is shown. */
  get shown(): Patch {
    return this.patch;
  }

  /** Moves the surface to the positions of another state of the same patch. */
  update(patch: Patch): void {
    this.patch = patch;
    const { geometry } = this.mesh;
    const [position, normal] = [
      geometry.getAttribute('position'),
      geometry.getAttribute('normal'),
    ] as BufferAttribute[];
    const normals = patch.normals ?? vertexNormals(patch.positions, patch.hole.patchFaces ?? []);
    for (const [corner, vertex] of this.corners.entries()) {
      const side = this.sides[corner] as number;
      for (let axis = 0; axis < 3; axis += 1) {
        const to = 3 * corner + axis;
        (position as BufferAttribute).array[to] = patch.positions[3 * vertex + axis] as number;
        (normal as BufferAttribute).array[to] =
          vertex < this.rim ? (this.firstNormals[to] as number) : side * (normals[3 * vertex + axis] as number);
      }
    }
    (position as BufferAttribute).needsUpdate = true;
    (normal as BufferAttribute).needsUpdate = true;
    geometry.computeBoundingSphere();
    geometry.computeBoundingBox();
  }

  /** The numbers of a heat map, of each patch vertex. */
  heatValues(heat: Heat): Float32Array {
    switch (heat) {
      case 'stretch':
        return patchStretch(this.patch);
      case 'curvature':
        return this.numbers().curvature;
      case 'confidence':
        return patchDeviations(this.patch);
    }
  }

  /** Colours it by a heat map. */
  paint(scale: HeatScale): void {
    const colors = heatColors(this.heatValues(scale.heat), this.numbers().shade, scale);
    const ofCorners = new Float32Array(3 * this.corners.length);
    for (const [corner, vertex] of this.corners.entries()) {
      ofCorners.set(colors.subarray(3 * vertex, 3 * vertex + 3), 3 * corner);
    }
    this.mesh.geometry.setAttribute('color', vectors(ofCorners));
  }

  /** Gives it the colours back that it has without a heat map. */
  unpaint(): void {
    const { geometry } = this.mesh;
    if (this.ownColors === undefined) {
      geometry.deleteAttribute('color');
    } else {
      geometry.setAttribute('color', this.ownColors);
    }
  }

  private numbers(): VertexNumbers {
    const { positions, hole } = this.patch;
    const vertices = Uint32Array.from({ length: positions.length / 3 }, (_, vertex) => vertex);
    return vertexNumbers(positions, hole.patchFaces ?? [], vertices);
  }

  /** The place of a hit on the mesh; undefined without a chart. */
  pointOf(hit: Intersection): ClothPoint | undefined {
    if (hit.face === null || hit.face === undefined || !hasChart(this.patch)) {
      return undefined;
    }
    const vertices = [hit.face.a, hit.face.b, hit.face.c].map((corner) => this.corners[corner] as number);
    const [a, b, c] = vertices.map((vertex) => this.vertex(vertex)) as [Vector3, Vector3, Vector3];
    const weights = Triangle.getBarycoord(hit.point, a, b, c, new Vector3())?.toArray();
    if (weights === undefined) {
      return undefined;
    }
    const uvs = this.patch.hole.patchUvs ?? [];
    const uv = [0, 1].map((axis) =>
      vertices.reduce((sum, vertex, i) => sum + (weights[i] as number) * (uvs[2 * vertex + axis] as number), 0),
    ) as Uv;
    return locate(this.patch, uv);
  }

  dispose(): void {
    this.image?.dispose();
    this.mesh.geometry.dispose();
  }

  private vertex(vertex: number): Vector3 {
    return new Vector3().fromArray(this.patch.positions, 3 * vertex);
  }
}

/** For each corner of the surface, the patch vertex at its position: the same numbers, or else the nearest one. */
function cornerTable(corners: Float32Array, vertices: Float32Array): Uint32Array {
  const keyOf = (values: Float32Array, at: number): string => values.subarray(3 * at, 3 * at + 3).join();
  const exact = new Map<string, number>();
  for (let vertex = 0; vertex < vertices.length / 3; vertex += 1) {
    exact.set(keyOf(vertices, vertex), vertex);
  }
  return Uint32Array.from({ length: corners.length / 3 }, (_, corner) => {
    return exact.get(keyOf(corners, corner)) ?? nearest(vertices, corners.subarray(3 * corner, 3 * corner + 3));
  });
}

function nearest(vertices: Float32Array, point: Float32Array): number {
  let best = { vertex: 0, distance: Number.POSITIVE_INFINITY };
  for (let vertex = 0; vertex < vertices.length / 3; vertex += 1) {
    const distance = [0, 1, 2].reduce((sum, axis) => {
      return sum + ((vertices[3 * vertex + axis] as number) - (point[axis] as number)) ** 2;
    }, 0);
    if (distance < best.distance) {
      best = { vertex, distance };
    }
  }
  return best.vertex;
}

/** The colours of a scan's vertices as they go on in a patch of so many corners, or their mean where one colour was asked for. */
function ownColors({ hole, dressing }: Patch, corners: number): BufferAttribute | undefined {
  const colors = Float32Array.from(hole.surface?.colors ?? []);
  const id = hole.id ?? 0;
  // A patch that does not continue the scan may have corners of its own.
  if (dressing.colours.has(id) || corners === 0 || colors.length !== 4 * corners) {
    return undefined;
  }
  if (dressing.textures.get(id)?.method === 'flat') {
    const mean = [0, 1, 2, 3].map((channel) => {
      return colors.reduce((sum, value, at) => (at % 4 === channel ? sum + value : sum), 0) / corners;
    });
    return new BufferAttribute(
      colors.map((_, at) => mean[at % 4] as number),
      4,
    );
  }
  return new BufferAttribute(colors, 4);
}

/** Unit normals of vertices: the mean of their faces', weighted by area. */
function vertexNormals(positions: Float32Array, faces: readonly number[]): Float32Array {
  const normals = new Float32Array(positions.length);
  const at = (vertex: number, axis: number): number => positions[3 * vertex + axis] as number;
  for (let face = 0; face + 2 < faces.length; face += 3) {
    const [a, b, c] = [faces[face], faces[face + 1], faces[face + 2]] as [number, number, number];
    const [x1, y1, z1] = [at(b, 0) - at(a, 0), at(b, 1) - at(a, 1), at(b, 2) - at(a, 2)];
    const [x2, y2, z2] = [at(c, 0) - at(a, 0), at(c, 1) - at(a, 1), at(c, 2) - at(a, 2)];
    for (const vertex of [a, b, c]) {
      normals[3 * vertex] = (normals[3 * vertex] as number) + y1 * z2 - z1 * y2;
      normals[3 * vertex + 1] = (normals[3 * vertex + 1] as number) + z1 * x2 - x1 * z2;
      normals[3 * vertex + 2] = (normals[3 * vertex + 2] as number) + x1 * y2 - y1 * x2;
    }
  }
  for (let start = 0; start < normals.length; start += 3) {
    const normal = normals.subarray(start, start + 3);
    const length = Math.hypot(...normal) || 1;
    normal.forEach((value, axis) => (normal[axis] = value / length));
  }
  return normals;
}

/** New cloth in a colour of its own. */
export const TINT = 0xf0a35e;

/** The material of a patch in one colour. */
export function plainlyColoured({ color, roughness, metalness }: PlainColour): Material {
  return new MeshStandardMaterial({ color: new Color(...color), roughness, metalness, side: DoubleSide });
}

/**
 * The material of a patch that continues the scan's: its own copy, so that the scan's can be exchanged. With an image of the patch's own it has that
 * and no other: the patch's texture coordinates lie in it.
 */
export function blendedMaterial(scan: Material | undefined, image: Texture | null): Material {
  if (image !== null) {
    const { roughness = 0.9, metalness = 0 } = (scan as MeshStandardMaterial | undefined) ?? {};
    return new MeshStandardMaterial({ map: image, roughness, metalness, side: DoubleSide });
  }
  return scan?.clone() ?? new MeshStandardMaterial({ color: 0xb9bec6 });
}
