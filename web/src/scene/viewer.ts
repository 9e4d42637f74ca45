/** The picture: a camera around the scan, the scan, its rims and the new cloth; drawn only when something has changed. */
import type { Loop } from '../client.js';
import type { ClothPoint } from '../model/cloth.js';
import { byKind } from '../model/loops.js';
import type { Dressing, Patch } from '../model/scan_session.js';
import {
  Box3,
  DirectionalLight,
  HemisphereLight,
  type Material,
  OrbitControls,
  PerspectiveCamera,
  Plane,
  Raycaster,
  Scene,
  Sphere,
  type Texture,
  Vector2,
  Vector3,
  WebGLRenderer,
} from '../vendor.js';
import type { EdgeEnds } from '../model/draft.js';
import { stretchBetween, pointsOf } from './border_stretch.js';
import { linesOfLoops } from './boundary.js';
import { Marks } from './marks.js';
import { PatchModel, type Surface, TINT, blendedMaterial, plainlyColoured, readSurfaces } from './patch_model.js';
import { Rims } from './rims.js';
import { type Heat, type HeatScale, heatColors, ownColors, scaleOf } from './heat_colors.js';
import { ScanModel, type Shading, heatOf, plainMaterial } from './scan_model.js';
import { stretchCells } from './stretch.js';

/** What the person chose to see. */
export interface Look {
  readonly shading: Shading;
  /** Whether the new cloth has a colour of its own. */
  readonly tinted: boolean;
  /** Whether boundary loops have lines. */
  readonly outlined: boolean;
  /** Whether the scan is shown without its new cloth. */
  readonly before: boolean;
  /** The share of the picture's width, from the left, that shows the scan without its new cloth. */
  readonly split: number;
}

export const FIRST_LOOK: Look = { shading: 'textured', tinted: true, outlined: true, before: false, split: 0 };

/** What is under the pointer. */
export interface Hit {
  readonly position: Vector3;
  /** The place on new cloth; undefined on the scan. */
  readonly cloth: ClothPoint | undefined;
  /** Whether it is on new cloth, with or without a chart. */
  readonly onPatch: boolean;
}

/** Draws into a canvas that fills `host`. */
export class Viewer {
  readonly camera = new PerspectiveCamera(35, 1, 0.01, 100);
  readonly controls: OrbitControls;
  readonly marks = new Marks();
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly raycaster = new Raycaster();
  private readonly resized: ResizeObserver;
  private scan: ScanModel | undefined;
  private rims: Rims | undefined;
  private patches: PatchModel[] = [];
  /** The heat map that is drawn. */
  private heat: HeatScale | undefined;
  /** The stretch of the scan around the holes of a dressing. */
  private stretch: { readonly dressing: Dressing | undefined; readonly values: Promise<Float32Array> } | undefined;
  /** Told what the colours of a heat map mean; with a scale once it is drawn. */
  onHeat: (heat: Heat | undefined, scale: HeatScale | undefined) => void = () => {};
  /** Told what could not be computed. */
  onError: (error: unknown) => void = () => {};
  /** Those that were asked for last; their surfaces may still be read. */
  private wanted: readonly Patch[] = [];
  private look = FIRST_LOOK;
  /** Around the scan. */
  private sphere: Sphere | undefined;
  private frameAsked = 0;

  constructor(private readonly host: HTMLElement) {
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.canvas.tabIndex = 0;
    host.append(this.canvas);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener('change', () => this.draw());
    const headlight = new DirectionalLight(0xffffff, 1.9);
    // From the side, so that folds show.
    headlight.position.set(1, 1.2, 0.9);
    this.camera.add(headlight);
    this.scene.add(this.camera, new HemisphereLight(0xffffff, 0x8d97a5, 1), this.marks.group);
    this.resized = new ResizeObserver(() => this.resize());
    this.resized.observe(host);
    this.canvas.addEventListener('webglcontextrestored', () => this.draw());
    this.resize();
  }

  get canvas(): HTMLCanvasElement {
    return this.renderer.domElement;
  }

  /** The name of what draws, for tests and reports. */
  get rendererName(): string {
    const gl = this.renderer.getContext();
    const info = gl.getExtension('WEBGL_debug_renderer_info');
    return String(gl.getParameter(info?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER));
  }

  /** Shows another scan in place of the one before, and frames it. */
  async showScan(bytes: ArrayBuffer, loops: readonly Loop[]): Promise<void> {
    const scan = await ScanModel.load(bytes.slice(0));
    this.clear();
    this.scan = scan;
    this.scene.add(scan.root);
    scan.setShading(this.shading);
    this.renewHeat();
    const sphere = scan.bounds.getBoundingSphere(new Sphere());
    this.lookAt(scan.bounds, new Vector3(0.5, 0.5, 1));
    const lines = await scan.boundaryLines();
    if (this.scan !== scan) {
      return;
    }
    this.rims = new Rims(loops, linesOfLoops(loops, lines), sphere.radius || 1);
    this.rims.setVisible(this.look.outlined);
    this.scene.add(this.rims.group);
    const largest = byKind(loops)[0]?.[1][0]?.id ?? 0;
    this.lookAt(scan.bounds, this.rims.viewOf(largest)?.front ?? new Vector3(0.5, 0.5, 1));
    // Nothing waits for it; a scan that takes its place stops it.
    scan.buildTrees().catch(() => undefined);
  }

  /** Draws the chosen loops wider. */
  chooseLoops(chosen: ReadonlySet<number>): void {
    this.rims?.choose(chosen);
    this.draw();
  }

  /** Shows new cloth. Where it is a state of the same patches, only its positions are sent to the graphics card. */
  async showPatches(patches: readonly Patch[]): Promise<void> {
    this.wanted = patches;
    const dressing = patches[0]?.dressing;
    if (!this.showsSurfacesOf(patches)) {
      const surfaces = dressing === undefined ? [] : await readSurfaces(dressing.glb.slice(0));
      // Others may have been asked for, or shown, since.
      if (this.wanted[0]?.dressing !== dressing) {
        return;
      }
      if (!this.showsSurfacesOf(this.wanted)) {
        this.replacePatches(surfaces);
        this.renewHeat();
      }
    }
    this.wanted.forEach((patch, i) => {
      const model = this.patches[i];
      if (model !== undefined && model.shown !== patch) {
        model.update(patch);
        if (this.heat !== undefined) {
          model.paint(this.heat);
        }
      }
    });
    this.draw();
  }

  /** Takes the scan's triangles out that are cut, by their middles, wherever the new cloth is shown. */
  showCut(middles: readonly number[]): void {
    this.scan?.cutOut(middles);
    this.draw();
  }

  /** The vertex of the cloth's own edge that is nearest to a point of the window, if one is near. */
  nearestOfBorder(clientX: number, clientY: number): Vector3 | undefined {
    const borders = this.rims?.borders ?? [];
    return this.nearestOf(
      borders.flatMap(pointsOf).map((point) => new Vector3(...point)),
      { x: clientX, y: clientY },
      40,
    );
  }

  /** The way along the cloth's own edge between its vertices nearest to two points: the shorter one, or that along the edge that faces it. */
  stretchBetween(edge: EdgeEnds, facing?: EdgeEnds): Vector3[] {
    const stretch = stretchBetween(this.rims?.borders ?? [], edge, facing);
    return stretch.map((point) => new Vector3(...point));
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

  /** Changes how things are drawn. */
  setLook(change: Partial<Look>): void {
    const before = this.look;
    this.look = { ...before, ...change };
    this.rims?.setVisible(this.look.outlined);
    if (before.shading !== this.look.shading) {
      this.renewHeat();
    }
    if (before.shading !== this.look.shading || before.tinted !== this.look.tinted) {
      this.renewMaterials();
    }
    this.draw();
  }

  private renewMaterials(): void {
    this.scan?.setShading(this.shading);
    for (const patch of this.patches) {
      patch.mesh.material.dispose();
      patch.mesh.material = this.materialOf(patch.shown, patch.image);
      if (heatOf(this.shading) === undefined) {
        patch.unpaint();
      }
    }
  }

  /** How surfaces are drawn now: without textures while a heat map is computed. */
  private get shading(): Shading {
    const { shading } = this.look;
    return heatOf(shading) === undefined || this.heat?.heat === shading ? shading : 'shaded';
  }

  private renewHeat(): void {
    const { scan } = this;
    this.showHeat().catch((error) => {
      // The work on a scan is stopped when another takes its place.
      if (this.scan === scan) {
        this.onError(error);
      }
    });
  }

  /** Computes and draws the heat map that was chosen, if one was. */
  private async showHeat(): Promise<void> {
    const { scan, look, patches } = this;
    const heat = heatOf(look.shading);
    if (heat === undefined || scan === undefined) {
      this.heat = undefined;
      this.onHeat(heat, undefined);
      return;
    }
    this.onHeat(heat, this.heat?.heat === heat ? this.heat : undefined);
    const [{ shade }, values] = await Promise.all([scan.numbers(), this.heatOfScan(heat, scan)]);
    // Another scan, other holes or another look may have been chosen since.
    if (this.scan !== scan || heatOf(this.look.shading) !== heat || this.patches !== patches) {
      return;
    }
    const ofPatches = patches.map((patch) => patch.heatValues(heat));
    this.heat = scaleOf(heat, values === undefined ? ofPatches : [values, ...ofPatches]);
    scan.paint(values === undefined ? ownColors(shade) : heatColors(values, shade, this.heat));
    for (const patch of patches) {
      patch.paint(this.heat);
    }
    this.renewMaterials();
    this.onHeat(heat, this.heat);
    this.draw();
  }

  /** The numbers of the scan's vertices; undefined for a map of the new cloth alone. */
  private async heatOfScan(heat: Heat, scan: ScanModel): Promise<Float32Array | undefined> {
    if (heat === 'confidence') {
      return undefined;
    }
    if (heat === 'curvature') {
      return (await scan.numbers()).curvature;
    }
    const dressing = this.wanted[0]?.dressing;
    if (this.stretch === undefined || this.stretch.dressing !== dressing) {
      this.stretch = { dressing, values: scan.stretch(stretchCells(this.wanted)) };
    }
    return this.stretch.values;
  }

  /** Moves the camera so that all of the scan fills the picture; or one loop, seen from its front. */
  frame(loop?: number): void {
    const view = loop === undefined ? undefined : this.rims?.viewOf(loop);
    this.lookAt(view?.bounds ?? this.scan?.bounds ?? new Box3(), view?.front ?? new Vector3());
  }

  /** Turns the camera about a point from now on. */
  pivotAt(point: Vector3): void {
    this.controls.target.copy(point);
    this.controls.update();
    this.draw();
  }

  /** What is under a point of the window. */
  pick(clientX: number, clientY: number): Hit | undefined {
    this.aim(clientX, clientY);
    const patches = this.look.before ? [] : this.patches;
    const cloth = this.raycaster.intersectObjects(
      patches.map(({ mesh }) => mesh),
      false,
    )[0];
    const scan = this.scan?.pick(this.raycaster);
    if (cloth !== undefined && cloth.distance <= (scan?.distance ?? Number.POSITIVE_INFINITY)) {
      const patch = this.patches.find(({ mesh }) => mesh === cloth.object);
      return { position: cloth.point, cloth: patch?.pointOf(cloth), onPatch: true };
    }
    return scan && { position: scan.point, cloth: undefined, onPatch: false };
  }

  /** Where the pointer's ray meets the plane through a point that faces the camera. */
  onScreenPlane(clientX: number, clientY: number, through: Vector3): Vector3 | undefined {
    this.aim(clientX, clientY);
    const plane = new Plane().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new Vector3()), through);
    return this.raycaster.ray.intersectPlane(plane, new Vector3()) ?? undefined;
  }

  /** The point of a line that the pointer's ray comes nearest to. */
  onLine(clientX: number, clientY: number, through: Vector3, direction: Vector3): Vector3 {
    this.aim(clientX, clientY);
    const { origin, direction: ray } = this.raycaster.ray;
    const between = through.clone().sub(origin);
    const cosine = direction.dot(ray);
    const along = (cosine * ray.dot(between) - direction.dot(between)) / Math.max(1 - cosine * cosine, 1e-6);
    return through.clone().addScaledVector(direction, along);
  }

  /** Draws at the next frame. */
  draw(): void {
    if (this.frameAsked === 0) {
      this.frameAsked = requestAnimationFrame(() => {
        this.frameAsked = 0;
        this.drawNow();
      });
    }
  }

  /** What is drawn as a PNG, its background transparent. */
  async picture(): Promise<Blob> {
    this.drawNow();
    // At once: after this task the browser may have cleared what was drawn.
    const picture = await new Promise<Blob | null>((resolve) => this.canvas.toBlob(resolve, 'image/png'));
    if (picture === null) {
      throw new Error('The browser made no picture.');
    }
    return picture;
  }

  dispose(): void {
    cancelAnimationFrame(this.frameAsked);
    this.clear();
    this.resized.disconnect();
    this.controls.dispose();
    this.renderer.dispose();
    this.canvas.remove();
  }

  private drawNow(): void {
    this.fitDepth();
    this.marks.fit(this.camera, this.host.clientHeight);
    const { clientWidth: width, clientHeight: height } = this.host;
    const split = Math.round(this.look.split * width);
    this.renderer.setScissorTest(split > 0);
    this.drawPart(split > 0 ? [split, width - split] : [0, width], height, !this.look.before);
    if (split > 0) {
      this.drawPart([0, split], height, false);
    }
  }

  private drawPart([left, width]: [number, number], height: number, mended: boolean): void {
    if (this.look.split > 0) {
      this.renderer.setScissor(left, 0, width, height);
    }
    this.patches.forEach(({ mesh }) => (mesh.visible = mended));
    this.scan?.setCut(mended);
    this.renderer.render(this.scene, this.camera);
    this.patches.forEach(({ mesh }) => (mesh.visible = true));
    this.scan?.setCut(true);
  }

  /** Moves the camera until a box fills the picture. @param from - Direction to look from; zero: the present one. */
  private lookAt(box: Box3, from: Vector3): void {
    const { center, radius } = box.getBoundingSphere(new Sphere());
    if (box.isEmpty() || !(radius > 0)) {
      return;
    }
    const narrow = Math.min(1, this.camera.aspect);
    const distance = (1.1 * radius) / Math.sin((this.camera.fov * Math.PI) / 360) / narrow;
    const away = from.lengthSq() > 0 ? from.clone() : this.camera.position.clone().sub(this.controls.target);
    this.controls.target.copy(center);
    this.camera.position.copy(center).addScaledVector(away.normalize(), distance);
    this.fitDepth();
    this.controls.update();
    this.draw();
  }

  private aim(clientX: number, clientY: number): void {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const device = new Vector2(((clientX - left) / width) * 2 - 1, 1 - ((clientY - top) / height) * 2);
    this.camera.updateMatrixWorld();
    this.raycaster.setFromCamera(device, this.camera);
  }

  private materialOf({ hole, dressing }: Patch, image: Texture | null): Material {
    const { shading } = this;
    const { tinted } = this.look;
    if (tinted && heatOf(shading) === undefined) {
      return plainMaterial(TINT, shading);
    }
    if (shading !== 'textured') {
      return plainMaterial(0xb9bec6, shading);
    }
    const plain = dressing.colours.get(hole.id ?? 0);
    if (plain !== undefined) {
      return plainlyColoured(plain);
    }
    const scan = this.scan?.materialNear(new Vector3().fromArray(hole.rimPositions ?? [0, 0, 0]));
    return blendedMaterial(scan, image);
  }

  /** Near and far planes that hold the whole scan, whatever its unit. */
  private fitDepth(): void {
    if (this.scan !== undefined) {
      this.sphere ??= this.scan.bounds.getBoundingSphere(new Sphere());
      const { center, radius } = this.sphere;
      const distance = this.camera.position.distanceTo(center);
      this.camera.far = distance + 4 * radius;
      this.camera.near = Math.max(distance - 4 * radius, this.camera.far / 5000);
      this.camera.updateProjectionMatrix();
    }
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width > 0 && height > 0) {
      this.renderer.setSize(width, height);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      this.drawNow();
    }
  }

  private clear(): void {
    this.clearPatches();
    this.marks.clear();
    if (this.scan !== undefined) {
      this.scene.remove(this.scan.root);
      this.scan.dispose();
    }
    if (this.rims !== undefined) {
      this.scene.remove(this.rims.group);
      this.rims.dispose();
    }
    this.scan = undefined;
    this.heat = undefined;
    this.stretch = undefined;
    this.rims = undefined;
    this.sphere = undefined;
  }

  private showsSurfacesOf(patches: readonly Patch[]): boolean {
    const same = (patch: Patch, i: number): boolean => this.patches[i]?.shown.dressing === patch.dressing;
    return patches.length === this.patches.length && patches.every(same);
  }

  private replacePatches(surfaces: readonly Surface[]): void {
    this.clearPatches();
    this.wanted.forEach((patch, i) => {
      const surface = surfaces[i];
      if (surface !== undefined) {
        const model = new PatchModel(patch, surface, this.materialOf(patch, surface.image));
        if (this.heat !== undefined) {
          model.paint(this.heat);
        }
        this.patches.push(model);
        this.scene.add(model.mesh);
      }
    });
  }

  private clearPatches(): void {
    for (const patch of this.patches) {
      this.scene.remove(patch.mesh);
      patch.mesh.material.dispose();
      patch.dispose();
    }
    this.patches = [];
  }
}
