/** The scan as three.js shows it: the file's own materials, or one for all, and picking on it. */
import {
  Box3,
  BufferAttribute,
  type BufferGeometry,
  DoubleSide,
  type Group,
  type Intersection,
  type Material,
  type Matrix4,
  Mesh,
  MeshBVH,
  MeshBasicMaterial,
  MeshStandardMaterial,
  type Raycaster,
  type Texture,
  Vector3,
  acceleratedRaycast,
} from '../vendor.js';
import type { BoundaryLine } from './boundary.js';
import { Middles, indexWithout } from './cut_faces.js';
import type { VertexNumbers } from './curvature.js';
import { GeometryJobs, type PlainMesh } from './geometry_jobs.js';
import type { Heat } from './heat_colors.js';
import { loadScene } from './scan_loader.js';
import type { StretchCells } from './stretch.js';

/** How surfaces are drawn. */
export type Shading = 'textured' | 'shaded' | 'wireframe' | Heat;

/** The heat map that a shading is; undefined for others. */
export function heatOf(shading: Shading): Heat | undefined {
  return shading === 'textured' || shading === 'shaded' || shading === 'wireframe' ? undefined : shading;
}

/** The colour of a surface without its texture. */
const PLAIN = 0xb9bec6;

/** Materials for the shadings that do not use the file's own. */
export function plainMaterial(color: number, shading: Shading): Material {
  if (heatOf(shading) !== undefined) {
    return new MeshBasicMaterial({ vertexColors: true, side: DoubleSide });
  }
  return new MeshStandardMaterial({ color, roughness: 0.85, side: DoubleSide, wireframe: shading === 'wireframe' });
}

type Colors = BufferGeometry['attributes'][string] | undefined;

/** A loaded scan. */
export class ScanModel {
  private readonly own = new Map<Mesh, Material | Material[]>();
  private readonly jobs = new GeometryJobs();
  /** The space that it takes. */
  readonly bounds: Box3;
  private plain: Material | undefined;
  private numbersAsked: Promise<VertexNumbers> | undefined;
  /** Colours that the file has itself, while others are shown. */
  private readonly ownColors = new Map<BufferGeometry, Colors>();
  /** Middles of the triangles that are cut out, and the index lists of the meshes that have such, whole and without. */
  private middles: readonly number[] = [];
  private readonly lists = new Map<Mesh, { whole: BufferAttribute | null; cut: BufferAttribute }>();

  private constructor(readonly root: Group) {
    root.updateMatrixWorld(true);
    this.bounds = new Box3().setFromObject(root);
    root.traverse((object) => {
      if (object instanceof Mesh) {
        this.own.set(object, object.material as Material | Material[]);
        if (!('isSkinnedMesh' in object)) {
          object.raycast = acceleratedRaycast;
        }
      }
    });
  }

  /** Reads a GLB, or a glTF with data URIs. */
  static async load(bytes: ArrayBuffer): Promise<ScanModel> {
    return new ScanModel(await loadScene(bytes));
  }

  get meshes(): Mesh[] {
    return [...this.own.keys()];
  }

  /** Chooses how the surface is drawn. */
  setShading(shading: Shading): void {
    if (heatOf(shading) === undefined) {
      this.unpaint();
    }
    this.plain?.dispose();
    const plain = shading === 'textured' ? undefined : plainMaterial(PLAIN, shading);
    this.plain = plain;
    for (const [mesh, own] of this.own) {
      mesh.material = plain ?? own;
    }
  }

  /** The file's own material of the mesh that has a vertex nearest to a point of the scene. */
  materialNear(point: Vector3): Material | undefined {
    let best: { distance: number; material: Material | undefined } | undefined;
    const vertex = new Vector3();
    for (const [mesh, own] of this.own) {
      const position = mesh.geometry.getAttribute('position');
      for (let at = 0; at < position.count; at += 1) {
        const distance = vertex
          .fromBufferAttribute(position, at)
          .applyMatrix4(mesh.matrixWorld)
          .distanceToSquared(point);
        if (distance < (best?.distance ?? Number.POSITIVE_INFINITY)) {
          best = { distance, material: Array.isArray(own) ? own[0] : own };
        }
      }
    }
    return best?.material;
  }

  /** The boundary loops of the whole scene. */
  boundaryLines(): Promise<BoundaryLine[]> {
    return this.jobs.boundary(this.wholeScene());
  }

  /** Curvature and shade of every vertex, mesh after mesh. */
  numbers(): Promise<VertexNumbers> {
    this.numbersAsked ??= this.jobs.numbers(this.wholeScene());
    return this.numbersAsked;
  }

  /** Stretch of every vertex, mesh after mesh; NaN away from the cells. */
  stretch(cells: StretchCells): Promise<Float32Array> {
    return this.jobs.stretch(this.wholeScene(), cells);
  }

  /** Gives every vertex a colour, mesh after mesh. */
  paint(colors: Float32Array): void {
    let start = 0;
    for (const mesh of this.meshes) {
      const { geometry } = mesh;
      const end = start + 3 * geometry.getAttribute('position').count;
      // Several meshes may share a geometry.
      if (!this.ownColors.has(geometry)) {
        this.ownColors.set(geometry, geometry.attributes.color);
      }
      geometry.setAttribute('color', vectors(colors.slice(start, end)));
      start = end;
    }
  }

  private unpaint(): void {
    for (const [geometry, own] of this.ownColors) {
      if (own === undefined) {
        geometry.deleteAttribute('color');
      } else {
        geometry.setAttribute('color', own);
      }
    }
    this.ownColors.clear();
  }

  private wholeScene(): PlainMesh {
    return joined(this.meshes.map((mesh) => this.whole(mesh, mesh.matrixWorld)));
  }

  /** Makes picking fast. Until then every triangle is tried. */
  async buildTrees(): Promise<void> {
    for (const mesh of this.meshes) {
      const tree = await this.jobs.tree(this.whole(mesh, undefined));
      this.setCut(false);
      mesh.geometry.boundsTree = MeshBVH.deserialize(tree, mesh.geometry);
      // It has put the triangles into another order.
      this.cutAgain();
    }
  }

  /** Takes triangles out, by their middles, in place of those before. */
  cutOut(middles: readonly number[]): void {
    if (middles !== this.middles) {
      this.middles = middles;
      this.cutAgain();
    }
  }

  /** Shows the scan with or without what is cut out. */
  setCut(isCut: boolean): void {
    for (const [mesh, { whole, cut }] of this.lists) {
      mesh.geometry.setIndex(isCut ? cut : whole);
    }
  }

  /** A mesh with what is cut out. */
  private whole(mesh: Mesh, matrix: Matrix4 | undefined): PlainMesh {
    const list = this.lists.get(mesh);
    return plainMesh(mesh.geometry, list === undefined ? mesh.geometry.index : list.whole, matrix);
  }

  private cutAgain(): void {
    this.setCut(false);
    this.lists.clear();
    if (this.middles.length === 0) {
      return;
    }
    const size = this.bounds.getSize(new Vector3()).length() + this.bounds.getCenter(new Vector3()).length();
    const middles = new Middles(this.middles, 1e-6 * size);
    for (const mesh of this.meshes) {
      const whole = mesh.geometry.index;
      const index = whole === null ? sequence(mesh.geometry.getAttribute('position').count) : whole.array;
      const left = indexWithout(scenePositions(mesh), new Uint32Array(index), middles);
      if (left !== undefined) {
        this.lists.set(mesh, { whole, cut: new BufferAttribute(left, 1) });
      }
    }
    this.setCut(true);
  }

  /** The nearest point of the scan on a ray. */
  pick(raycaster: Raycaster): Intersection | undefined {
    raycaster.firstHitOnly = true;
    return raycaster.intersectObjects(this.meshes, false)[0];
  }

  /** Frees the memory of the graphics card. */
  dispose(): void {
    this.jobs.stop();
    this.plain?.dispose();
    for (const [mesh, own] of this.own) {
      mesh.geometry.dispose();
      for (const material of Array.isArray(own) ? own : [own]) {
        disposeMaterial(material);
      }
    }
  }
}

/** A mesh's triangles as plain arrays, in the scene's space or, without a matrix, in its own. */
function plainMesh(geometry: BufferGeometry, index: BufferAttribute | null, matrix: Matrix4 | undefined): PlainMesh {
  const position = geometry.getAttribute('position');
  const positions = new Float32Array(3 * position.count);
  const vertex = new Vector3();
  for (let at = 0; at < position.count; at += 1) {
    vertex.fromBufferAttribute(position, at);
    if (matrix !== undefined) {
      vertex.applyMatrix4(matrix);
    }
    vertex.toArray(positions, 3 * at);
  }
  const triangles = index === null ? sequence(position.count) : new Uint32Array(index.array);
  return { positions, triangles };
}

/** A mesh's vertices in the scene's space, as exactly as the file has them. */
function scenePositions({ geometry, matrixWorld }: Mesh): Float64Array {
  const position = geometry.getAttribute('position');
  const positions = new Float64Array(3 * position.count);
  const vertex = new Vector3();
  for (let at = 0; at < position.count; at += 1) {
    vertex.fromBufferAttribute(position, at).applyMatrix4(matrixWorld);
    positions.set([vertex.x, vertex.y, vertex.z], 3 * at);
  }
  return positions;
}

/** 0, 1, 2 and so on. */
function sequence(length: number): Uint32Array<ArrayBuffer> {
  const numbers = new Uint32Array(length);
  for (let at = 0; at < length; at += 1) {
    numbers[at] = at;
  }
  return numbers;
}

/** Several meshes as one. */
function joined(meshes: readonly PlainMesh[]): PlainMesh {
  const sizeOf = (arrays: readonly { length: number }[]): number => arrays.reduce((sum, it) => sum + it.length, 0);
  const positions = new Float32Array(sizeOf(meshes.map((mesh) => mesh.positions)));
  const triangles = new Uint32Array(sizeOf(meshes.map((mesh) => mesh.triangles)));
  let [firstNumber, firstCorner] = [0, 0];
  for (const mesh of meshes) {
    positions.set(mesh.positions, firstNumber);
    const firstVertex = firstNumber / 3;
    triangles.set(
      mesh.triangles.map((vertex) => vertex + firstVertex),
      firstCorner,
    );
    firstNumber += mesh.positions.length;
    firstCorner += mesh.triangles.length;
  }
  return { positions, triangles };
}

/** Frees a material and its textures. */
export function disposeMaterial(material: Material): void {
  for (const value of Object.values(material)) {
    if (typeof value === 'object' && value !== null && 'isTexture' in value) {
      (value as Texture).dispose();
    }
  }
  material.dispose();
}

/** A float attribute of three values each. */
export function vectors(values: Float32Array): BufferAttribute {
  return new BufferAttribute(values, 3);
}
