/** The scan as three.js shows it: the file's own materials, or one for all, and picking on it. */
import {
  Box3,
  BufferAttribute,
  DoubleSide,
  GLTFLoader,
  Group,
  type Intersection,
  type Material,
  type Matrix4,
  Mesh,
  MeshBVH,
  MeshStandardMaterial,
  MeshoptDecoder,
  type Raycaster,
  type Texture,
  Vector3,
  acceleratedRaycast,
} from '../vendor.js';
import type { BoundaryLine } from './boundary.js';
import { GeometryJobs, type PlainMesh } from './geometry_jobs.js';

/** How surfaces are drawn. */
export type Shading = 'textured' | 'shaded' | 'wireframe';

/** The colour of a surface without its texture. */
const PLAIN = 0xb9bec6;

/** Materials for the shadings that do not use the file's own. */
export function plainMaterial(color: number, shading: Shading): MeshStandardMaterial {
  return new MeshStandardMaterial({ color, roughness: 0.85, side: DoubleSide, wireframe: shading === 'wireframe' });
}

/** A loaded scan. */
export class ScanModel {
  private readonly own = new Map<Mesh, Material | Material[]>();
  private readonly jobs = new GeometryJobs();
  /** The space that it takes. */
  readonly bounds: Box3;
  private plain: MeshStandardMaterial | undefined;

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
    const gltf = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).parseAsync(bytes, '');
    return new ScanModel(gltf.scene);
  }

  get meshes(): Mesh[] {
    return [...this.own.keys()];
  }

  /** Chooses how the surface is drawn. */
  setShading(shading: Shading): void {
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
    return this.jobs.boundary(joined(this.meshes.map((mesh) => plainMesh(mesh, mesh.matrixWorld))));
  }

  /** Makes picking fast. Until then every triangle is tried. */
  async buildTrees(): Promise<void> {
    for (const mesh of this.meshes) {
      const tree = await this.jobs.tree(plainMesh(mesh, undefined));
      mesh.geometry.boundsTree = MeshBVH.deserialize(tree, mesh.geometry);
    }
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
function plainMesh({ geometry }: Mesh, matrix: Matrix4 | undefined): PlainMesh {
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
  const triangles = geometry.index === null ? sequence(position.count) : new Uint32Array(geometry.index.array);
  return { positions, triangles };
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
