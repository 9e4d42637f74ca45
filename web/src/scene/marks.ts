/** Marks of a gesture: the handle under the pointer, the tether to the cloth, the disk of a twist, the ball or polygon of a cut, the stretch of a border. */
import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  Group,
  Line,
  Line2,
  LineBasicMaterial,
  LineGeometry,
  LineLoop,
  LineMaterial,
  Mesh,
  MeshBasicMaterial,
  type PerspectiveCamera,
  SphereGeometry,
  Vector3,
} from '../vendor.js';
import { MOVES } from './still_layer.js';

/** Radius of a handle in CSS pixels. */
const HANDLE_RADIUS = 7;
/** Corners of a ring. */
const RING_CORNERS = 64;

/** The colours of what a hand holds and of what is taken away. */
const HAND = 0x0b7285;
const CUT = 0xc2255c;
const LIGHT = 0xf1f3f5;
/** The name of the ball of a cut, whose size is the scene's. */
const BALL = 'cut';
/** The name of the disk of a twist. */
const DISK = 'twist';

/** What is marked. */
export interface Marked {
  /** Points that a hand holds. */
  readonly handles?: readonly Vector3[];
  /** Lines from the cloth to where it should be: what it did not follow. */
  readonly tethers?: readonly (readonly [Vector3, Vector3])[];
  /** A closed line. */
  readonly ring?: readonly Vector3[];
  /** A see-through surface from a point to a closed line around it. */
  readonly disk?: { readonly center: Vector3; readonly ring: readonly Vector3[] };
  /** A ball that shows where it goes through the cloth. */
  readonly ball?: { readonly center: Vector3; readonly radius: number };
  /** Broad lines. */
  readonly stretches?: readonly (readonly Vector3[])[];
  /** Broad dashed lines. */
  readonly dashes?: readonly (readonly Vector3[])[];
}

/** The marks, drawn over everything. */
export class Marks {
  readonly group = new Group();
  private readonly ball = new SphereGeometry(1, 24, 16);
  private readonly ballMaterial = new MeshBasicMaterial({ color: HAND, depthTest: false, transparent: true });
  private readonly cutMaterial = new MeshBasicMaterial({
    color: CUT,
    transparent: true,
    opacity: 0.35,
    depthWrite: false,
    side: DoubleSide,
  });
  private readonly diskMaterial = new MeshBasicMaterial({
    color: HAND,
    transparent: true,
    opacity: 0.3,
    depthTest: false,
    side: DoubleSide,
  });
  private readonly lineMaterial = new LineBasicMaterial({ color: HAND, depthTest: false, transparent: true });

  /** Those that are shown, as a text to compare. */
  private shown = '{}';

  /** Shows these marks in place of those before. Whether they are others. */
  show(marked: Marked): boolean {
    const text = JSON.stringify(marked);
    if (text === this.shown) {
      return false;
    }
    this.clear();
    this.shown = text;
    this.add(marked);
    return true;
  }

  private add({ handles = [], tethers = [], ring = [], disk, ball, stretches = [], dashes = [] }: Marked): void {
    if (ball !== undefined) {
      const mark = new Mesh(this.ball, this.cutMaterial);
      mark.position.copy(ball.center);
      mark.scale.setScalar(ball.radius);
      mark.name = BALL;
      this.group.add(mark);
    }
    if (disk !== undefined) {
      const mark = new Mesh(fan(disk.center, disk.ring), this.diskMaterial);
      mark.name = DISK;
      this.group.add(mark);
    }
    for (const stretch of stretches.filter((line) => line.length > 1)) {
      this.group.add(broadLine(stretch, { color: CUT, linewidth: 6 }));
    }
    for (const line of dashes.filter((each) => each.length > 1)) {
      const length = line.reduce((sum, point, at) => sum + point.distanceTo(line[Math.max(at - 1, 0)] ?? point), 0);
      const dash = { dashed: true, dashSize: length / 30, gapSize: length / 40 };
      // Light below, so that it is seen on a dark page, too.
      this.group.add(broadLine(line, { color: LIGHT, linewidth: 5 }));
      this.group.add(broadLine(line, { color: HAND, linewidth: 3, ...dash }));
    }
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
    for (const mark of this.group.children) {
      mark.renderOrder = 10;
      mark.layers.set(MOVES);
    }
  }

  clear(): void {
    this.shown = '{}';
    for (const mark of this.group.children) {
      if (mark instanceof Line2) {
        mark.geometry.dispose();
        mark.material.dispose();
      } else if (mark instanceof Line || mark.name === DISK) {
        (mark as Mesh<BufferGeometry>).geometry.dispose();
      }
    }
    this.group.clear();
  }

  /** Gives handles their size on the screen. */
  fit(camera: PerspectiveCamera, height: number): void {
    const perPixel = (2 * Math.tan((camera.fov * Math.PI) / 360)) / Math.max(height, 1);
    for (const mark of this.group.children) {
      if (mark instanceof Mesh && mark.geometry === this.ball && mark.name !== BALL) {
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

/** Triangles from a point to a closed line. */
function fan(center: Vector3, ring: readonly Vector3[]): BufferGeometry {
  const corners = ring.flatMap((point, at) => [center, point, ring[(at + 1) % ring.length] ?? point]);
  return lineGeometry(corners);
}

function broadLine(points: readonly Vector3[], look: ConstructorParameters<typeof LineMaterial>[0]): Line2 {
  const geometry = new LineGeometry();
  geometry.setPositions(points.flatMap((point) => point.toArray()));
  const line = new Line2(geometry, new LineMaterial({ depthTest: false, transparent: true, ...look }));
  line.computeLineDistances();
  return line;
}

function lineGeometry(points: readonly Vector3[]): BufferGeometry {
  const positions = new Float32Array(points.flatMap((point) => point.toArray()));
  return new BufferGeometry().setAttribute('position', new BufferAttribute(positions, 3));
}
