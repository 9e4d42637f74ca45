/** Marks of a gesture: the handle under the pointer, the tether to the cloth, the ring of a twist. */
import {
  BufferAttribute,
  BufferGeometry,
  Group,
  Line,
  LineBasicMaterial,
  LineLoop,
  Mesh,
  MeshBasicMaterial,
  type PerspectiveCamera,
  SphereGeometry,
  Vector3,
} from '../vendor.js';

/** Radius of a handle in CSS pixels. */
const HANDLE_RADIUS = 7;
/** Corners of a ring. */
const RING_CORNERS = 64;

/** What is marked. */
export interface Marked {
  /** Points that a hand holds. */
  readonly handles?: readonly Vector3[];
  /** Lines from the cloth to where it should be: what it did not follow. */
  readonly tethers?: readonly (readonly [Vector3, Vector3])[];
  /** A closed line. */
  readonly ring?: readonly Vector3[];
}

/** The marks, drawn over everything. */
export class Marks {
  readonly group = new Group();
  private readonly ball = new SphereGeometry(1, 24, 16);
  private readonly ballMaterial = new MeshBasicMaterial({ color: 0x0b7285, depthTest: false, transparent: true });
  private readonly lineMaterial = new LineBasicMaterial({ color: 0x0b7285, depthTest: false, transparent: true });

  /** Shows these marks in place of those before. */
  show({ handles = [], tethers = [], ring = [] }: Marked): void {
    this.clear();
    for (const position of handles) {
      const handle = new Mesh(this.ball, this.ballMaterial);
      handle.position.copy(position);
      this.group.add(handle);
    }
    for (const tether of tethers) {
      this.group.add(new Line(lineGeometry(tether), this.lineMaterial));
    }
    if (ring.length > 0) {
      this.group.add(new LineLoop(lineGeometry(ring), this.lineMaterial));
    }
    this.group.children.forEach((mark) => (mark.renderOrder = 10));
  }

  clear(): void {
    for (const mark of this.group.children) {
      if (mark instanceof Line) {
        (mark.geometry as BufferGeometry).dispose();
      }
    }
    this.group.clear();
  }

  /** Gives handles their size on the screen. */
  fit(camera: PerspectiveCamera, height: number): void {
    const perPixel = (2 * Math.tan((camera.fov * Math.PI) / 360)) / Math.max(height, 1);
    for (const mark of this.group.children) {
      if (mark instanceof Mesh) {
        mark.scale.setScalar(HANDLE_RADIUS * perPixel * camera.position.distanceTo(mark.position));
      }
    }
  }
}

/** The corners of a circle about a point. */
export function circle(center: Vector3, normal: Vector3, radius: number): Vector3[] {
  const side = Math.abs(normal.x) < 0.9 ? new Vector3(1, 0, 0) : new Vector3(0, 1, 0);
  const first = side.cross(normal).normalize();
  const second = new Vector3().crossVectors(normal, first).normalize();
  return Array.from({ length: RING_CORNERS }, (_, corner) => {
    const angle = (2 * Math.PI * corner) / RING_CORNERS;
    const point = center.clone().addScaledVector(first, radius * Math.cos(angle));
    return point.addScaledVector(second, radius * Math.sin(angle));
  });
}

function lineGeometry(points: readonly Vector3[]): BufferGeometry {
  const positions = new Float32Array(points.flatMap((point) => point.toArray()));
  return new BufferGeometry().setAttribute('position', new BufferAttribute(positions, 3));
}
