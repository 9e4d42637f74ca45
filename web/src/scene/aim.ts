/** From a point of the window into the scene. */
import { type PerspectiveCamera, Plane, Raycaster, Vector2, Vector3 } from '../vendor.js';
import { MOVES } from './still_layer.js';

/** Aims through a canvas that shows what a camera sees. */
export class Aim {
  private readonly raycaster = new Raycaster();

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly camera: PerspectiveCamera,
  ) {
    this.raycaster.layers.enable(MOVES);
  }

  /** The ray through a point of the window, until the next is asked for. */
  at(clientX: number, clientY: number): Raycaster {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const device = new Vector2(((clientX - left) / width) * 2 - 1, 1 - ((clientY - top) / height) * 2);
    this.camera.updateMatrixWorld();
    this.raycaster.setFromCamera(device, this.camera);
    return this.raycaster;
  }

  /** Where the pointer's ray meets the plane through a point that faces the camera. */
  onScreenPlane(clientX: number, clientY: number, through: Vector3): Vector3 | undefined {
    const { ray } = this.at(clientX, clientY);
    const plane = new Plane().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new Vector3()), through);
    return ray.intersectPlane(plane, new Vector3()) ?? undefined;
  }

  /** The point of a line that the pointer's ray comes nearest to. */
  onLine(clientX: number, clientY: number, through: Vector3, direction: Vector3): Vector3 {
    const { origin, direction: ray } = this.at(clientX, clientY).ray;
    const between = through.clone().sub(origin);
    const cosine = direction.dot(ray);
    const along = (cosine * ray.dot(between) - direction.dot(between)) / Math.max(1 - cosine * cosine, 1e-6);
    return through.clone().addScaledVector(direction, along);
  }

  /** Of some points the one that is drawn nearest to a point of the window, at most so many CSS pixels away. */
  nearestOf(points: readonly Vector3[], at: { x: number; y: number }, most: number): Vector3 | undefined {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    this.camera.updateMatrixWorld();
    let best: { point: Vector3; distance: number } | undefined;
    const place = new Vector3();
    for (const point of points) {
      place.copy(point).project(this.camera);
      const [x, y] = [left + ((place.x + 1) / 2) * width, top + ((1 - place.y) / 2) * height];
      const distance = Math.hypot(x - at.x, y - at.y);
      if (Math.abs(place.z) <= 1 && distance <= Math.min(most, best?.distance ?? most)) {
        best = { point, distance };
      }
    }
    return best?.point;
  }
}
