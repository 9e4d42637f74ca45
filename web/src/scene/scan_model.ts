/** The scan as three.js shows it: the file's own materials, or one for all, and picking on it. */
import {
  Box3,
  BufferAttribute,
  DoubleSide,
  GLTFLoader,
  Group,
  type Intersection,
  type Material,
  Mesh,
  MeshBVH,
  MeshStandardMaterial,
  type Raycaster,
  type Texture,
  Vector3,
  acceleratedRaycast,
} from '../vendor.js';
import { type BoundaryLine, boundaryLines } from './boundary.js';

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
  private plain: MeshStandardMaterial | undefined;

  private constructor(readonly root: Group) {
    root.updateMatrixWorld(true);
    root.traverse((object) => {
      if (object instanceof Mesh) {
        this.own.set(object, object.material as Material | Material[]);
        object.raycast = acceleratedRaycast;
      }
    });
  }

  /** Reads a GLB, or a glTF with data URIs. */
  static async load(bytes: ArrayBuffer): Promise<ScanModel> {
    const gltf = await new GLTFLoader().parseAsync(bytes, '');
    return new ScanModel(gltf.scene);
  }

  get meshes(): Mesh[] {
    return [...this.own.keys()];
  }

  get bounds(): Box3 {
    return new Box3().setFromObject(this.root);
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
  boundaryLines(): BoundaryLine[] {
    const { positions, triangles } = this.triangles();
    return boundaryLines(positions, triangles);
  }

  /** The nearest point of the scan on a ray. */
  pick(raycaster: Raycaster): Intersection | undefined {
    for (const mesh of this.own.keys()) {
      // Built at the first pick: a scan that is only mended needs none.
      mesh.geometry.boundsTree ??= new MeshBVH(mesh.geometry);
    }
    raycaster.firstHitOnly = true;
    return raycaster.intersectObjects(this.meshes, false)[0];
  }

  /** Frees the memory of the graphics card. */
  dispose(): void {
    this.plain?.dispose();
    for (const [mesh, own] of this.own) {
      mesh.geometry.dispose();
      for (const material of Array.isArray(own) ? own : [own]) {
        disposeMaterial(material);
      }
    }
  }

  private triangles(): { positions: Float32Array; triangles: Uint32Array } {
    const vertices = this.meshes.reduce((sum, { geometry }) => sum + geometry.getAttribute('position').count, 0);
    const corners = this.meshes.reduce(
      (sum, { geometry }) => sum + (geometry.index ?? geometry.getAttribute('position')).count,
      0,
    );
    const positions = new Float32Array(3 * vertices);
    const triangles = new Uint32Array(corners);
    const vertex = new Vector3();
    let [firstVertex, firstCorner] = [0, 0];
    for (const mesh of this.meshes) {
      const position = mesh.geometry.getAttribute('position');
      for (let at = 0; at < position.count; at += 1) {
        vertex.fromBufferAttribute(position, at).applyMatrix4(mesh.matrixWorld);
        vertex.toArray(positions, 3 * (firstVertex + at));
      }
      const { index } = mesh.geometry;
      const count = index?.count ?? position.count;
      for (let at = 0; at < count; at += 1) {
        triangles[firstCorner + at] = firstVertex + (index?.getX(at) ?? at);
      }
      firstVertex += position.count;
      firstCorner += count;
    }
    return { positions, triangles };
  }
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
