/** The picture: the scan, its rims, the new cloth and what is marked. */
import type { Loop } from '../client.js';
import type { ClothPoint } from '../model/cloth.js';
import { byKind } from '../model/loops.js';
import type { Dressing, Patch } from '../model/scan_session.js';
import {
  Box3,
  DirectionalLight,
  HemisphereLight,
  type Material,
  type OrbitControls,
  type PerspectiveCamera,
  Sphere,
  type Texture,
  Vector3,
} from '../vendor.js';
import type { BorderDraft } from '../model/draft.js';
import { Aim } from './aim.js';
import { type BorderLines, borderLines } from './border_stretch.js';
import { linesOfLoops } from './boundary.js';
import { type Marked, Marks } from './marks.js';
import { PatchModel, type Surface, TINT, blendedMaterial, plainlyColoured, readSurfaces } from './patch_model.js';
import { Rims } from './rims.js';
import { type Heat, type HeatScale, heatColors, ownColors, scaleOf } from './heat_colors.js';
import { ScanModel, type Shading, heatOf, plainMaterial } from './scan_model.js';
import { Screen } from './screen.js';
import { MOVES } from './still_layer.js';
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
  readonly marks = new Marks();
  readonly aim: Aim;
  private readonly screen: Screen;
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
  private chosen: ReadonlySet<number> | undefined;
  private cutFaces: readonly number[] = [];

  constructor(host: HTMLElement) {
    this.screen = new Screen(host, {
      look: () => this.look,
      arrange: (mended) => {
        this.patches.forEach(({ mesh }) => (mesh.visible = mended));
        this.scan?.setCut(mended);
      },
      fit: (height) => this.marks.fit(camera, height),
    });
    const { scene, camera } = this.screen;
    this.aim = new Aim(this.canvas, camera);
    const headlight = new DirectionalLight(0xffffff, 1.9);
    // From the side, so that folds show.
    headlight.position.set(1, 1.2, 0.9);
    camera.add(headlight);
    const skylight = new HemisphereLight(0xffffff, 0x8d97a5, 1);
    for (const light of [headlight, skylight]) {
      light.layers.enable(MOVES);
    }
    scene.add(camera, skylight, this.marks.group);
  }

  get canvas(): HTMLCanvasElement {
    return this.screen.canvas;
  }

  get camera(): PerspectiveCamera {
    return this.screen.camera;
  }

  get controls(): OrbitControls {
    return this.screen.controls;
  }

  /** The name of what draws, for tests and reports. */
  get rendererName(): string {
    return this.screen.rendererName;
  }

  /** Whether everything is drawn, with all pixels. */
  get isStill(): boolean {
    return this.screen.isStill;
  }

  /** Shows another scan in place of the one before, and frames it. */
  async showScan(bytes: ArrayBuffer, loops: readonly Loop[]): Promise<void> {
    const scan = await ScanModel.load(bytes.slice(0));
    this.clear();
    this.scan = scan;
    this.screen.scene.add(scan.root);
    this.screen.setBounds(scan.bounds);
    scan.setShading(this.shading);
    this.renewHeat();
    const sphere = scan.bounds.getBoundingSphere(new Sphere());
    this.screen.lookAt(scan.bounds, new Vector3(0.5, 0.5, 1));
    const lines = await scan.boundaryLines();
    if (this.scan !== scan) {
      return;
    }
    this.rims = new Rims(loops, linesOfLoops(loops, lines), sphere.radius || 1);
    this.rims.setVisible(this.look.outlined);
    this.rims.choose(this.chosen ?? new Set());
    this.screen.scene.add(this.rims.group);
    const largest = byKind(loops)[0]?.[1][0]?.id ?? 0;
    this.screen.lookAt(scan.bounds, this.rims.viewOf(largest)?.front ?? new Vector3(0.5, 0.5, 1));
    // Nothing waits for it; a scan that takes its place stops it.
    scan.buildTrees().catch(() => undefined);
  }

  /** Draws the chosen loops wider. */
  chooseLoops(chosen: ReadonlySet<number>): void {
    if (chosen !== this.chosen) {
      this.chosen = chosen;
      this.rims?.choose(chosen);
      this.draw();
    }
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
        this.draw();
      }
    }
    const moved = this.wanted.filter((patch, i) => this.move(patch, this.patches[i]));
    if (moved.length > 0) {
      this.screen.draw('cloth');
    }
  }

  /** Gives new cloth other positions. Whether it had others. */
  private move(patch: Patch, model: PatchModel | undefined): boolean {
    if (model === undefined || model.shown === patch) {
      return false;
    }
    model.update(patch);
    if (this.heat !== undefined) {
      model.paint(this.heat);
    }
    return true;
  }

  /** Marks something in place of what was marked. Other new cloth comes in so many milliseconds, or fewer. */
  mark(marked: Marked, wait: number): void {
    if (this.marks.show(marked)) {
      this.screen.drawMarks(wait);
    }
  }

  /** Takes the scan's triangles out that are cut, by their middles, wherever the new cloth is shown. */
  showCut(middles: readonly number[]): void {
    if (middles !== this.cutFaces) {
      this.cutFaces = middles;
      this.scan?.cutOut(middles);
      this.draw();
    }
  }

  /** The vertex of the cloth's own edge that is drawn nearest to a point of the window, if one is near. */
  nearestOfBorder(clientX: number, clientY: number): Vector3 | undefined {
    return this.aim.nearestOf(this.rims?.vertices ?? [], { x: clientX, y: clientY }, 40)?.clone();
  }

  /** Which way along the cloth's own edge the service will mend, and where the new hem will be. */
  borderLines(draft: BorderDraft): BorderLines {
    return borderLines(this.rims?.edges ?? [], draft);
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
    this.screen.lookAt(view?.bounds ?? this.scan?.bounds ?? new Box3(), view?.front ?? new Vector3());
  }

  /** Turns the camera about a point from now on. */
  pivotAt(point: Vector3): void {
    this.screen.pivotAt(point);
  }

  /** What is under a point of the window. */
  pick(clientX: number, clientY: number): Hit | undefined {
    const ray = this.aim.at(clientX, clientY);
    const patches = this.look.before ? [] : this.patches;
    const cloth = ray.intersectObjects(
      patches.map(({ mesh }) => mesh),
      false,
    )[0];
    const scan = this.scan?.pick(ray);
    if (cloth !== undefined && cloth.distance <= (scan?.distance ?? Number.POSITIVE_INFINITY)) {
      const patch = this.patches.find(({ mesh }) => mesh === cloth.object);
      return { position: cloth.point, cloth: patch?.pointOf(cloth), onPatch: true };
    }
    return scan && { position: scan.point, cloth: undefined, onPatch: false };
  }

  /** Draws at the next frame. */
  private draw(): void {
    this.screen.draw();
  }

  /** What is drawn as a PNG, its background transparent. */
  picture(): Promise<Blob> {
    return this.screen.picture();
  }

  dispose(): void {
    this.clear();
    this.screen.dispose();
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

  private clear(): void {
    this.clearPatches();
    this.marks.clear();
    if (this.scan !== undefined) {
      this.screen.scene.remove(this.scan.root);
      this.scan.dispose();
    }
    if (this.rims !== undefined) {
      this.screen.scene.remove(this.rims.group);
      this.rims.dispose();
    }
    this.scan = undefined;
    this.heat = undefined;
    this.stretch = undefined;
    this.rims = undefined;
    this.cutFaces = [];
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
        model.mesh.layers.set(MOVES);
        this.screen.scene.add(model.mesh);
      }
    });
  }

  private clearPatches(): void {
    for (const patch of this.patches) {
      this.screen.scene.remove(patch.mesh);
      patch.mesh.material.dispose();
      patch.dispose();
    }
    this.patches = [];
  }
}
