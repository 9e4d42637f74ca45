/** The canvas and the camera: a scene is drawn when something has changed, and for less time a frame while it moves where frames take long. */
import { type Box3, OrbitControls, PerspectiveCamera, Scene, Sphere, type Vector3, WebGLRenderer } from '../vendor.js';
import { Pace } from './pace.js';
import { StillLayer, showAll } from './still_layer.js';

/** Shares of the pixels of a side, from the best picture to the fastest, for a camera that moves. */
const CAMERA_WAYS = [1, 0.7, 0.5, 0.35];
/** The same for cloth that moves. From the second on, all but the cloth is drawn once. */
const CLOTH_WAYS = [1, 1, 0.7, 0.5, 0.35];
/** Milliseconds without a change after which the picture is still. */
const STILL = 250;
/** Milliseconds between two looks whether a frame is finished. */
const LOOK = 2;

/** What has changed since the frame before: the new cloth and its marks alone, or anything. */
type Change = 'cloth' | 'all';

/** What is drawn. */
export interface Drawn {
  /** Whether all of it is shown without its new cloth, or which share of the picture's width, from the left. */
  look(): { readonly before: boolean; readonly split: number };
  /** Shows the scan with or without its new cloth from now on. */
  arrange(mended: boolean): void;
  /** Gives marks their size in a picture so many CSS pixels high. */
  fit(height: number): void;
}

/** Draws into a canvas that fills `host`. */
export class Screen {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(35, 1, 0.01, 100);
  readonly controls: OrbitControls;
  private readonly renderer: WebGLRenderer;
  private readonly stays = new StillLayer(this.scene);
  private readonly resized: ResizeObserver;
  private paces = newPaces();
  /** Around what is shown. */
  private sphere: Sphere | undefined;
  /** Forgets the frame that was asked for. */
  private forgetFrame: (() => void) | undefined;
  /** What the next frame shows that the one before did not. */
  private change: Change | undefined;
  /** When the last frame was finished. */
  private finishedAt = Number.NEGATIVE_INFINITY;
  /** Frames that are not finished. */
  private inFlight = 0;
  /** Whether the last frame has all pixels. */
  private isFull = true;
  private stillTimer: ReturnType<typeof setTimeout> | undefined;
  private laterTimer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly host: HTMLElement,
    private readonly drawn: Drawn,
  ) {
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.setPixelRatio(pixelRatio());
    showAll(this.camera);
    this.canvas.tabIndex = 0;
    host.append(this.canvas);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener('change', () => this.draw());
    this.resized = new ResizeObserver(() => this.resize());
    this.resized.observe(host);
    this.canvas.addEventListener('webglcontextrestored', () => this.draw());
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

  /** Whether everything is drawn, with all pixels. */
  get isStill(): boolean {
    return this.change === undefined && this.inFlight === 0 && this.isFull;
  }

  /** Draws at the next frame, or when the one before is finished. */
  draw(change: Change = 'all'): void {
    this.change = this.change === 'all' ? 'all' : change;
    clearTimeout(this.laterTimer);
    this.laterTimer = undefined;
    if (this.forgetFrame !== undefined) {
      return;
    }
    if (change === 'cloth' && this.paces.cloth.way > 0) {
      // A frame that takes long is begun at once.
      const timer = setTimeout(this.drawAsked);
      this.forgetFrame = () => clearTimeout(timer);
    } else {
      const frame = requestAnimationFrame(this.drawAsked);
      this.forgetFrame = () => cancelAnimationFrame(frame);
    }
  }

  private readonly drawAsked = (): void => {
    this.forgetFrame = undefined;
    // While others are being drawn, this waits: frames that queue up show what is long past.
    if (this.change !== undefined && this.inFlight < (this.isSlow ? 1 : 2)) {
      this.drawFrame(this.change);
    }
  };

  /** Whether frames take long. */
  private get isSlow(): boolean {
    return this.paces.camera.way + this.paces.cloth.way > 0;
  }

  /**
   * Draws marks that were moved. Where cloth takes long to draw and more of it is about to come, they wait for it at most so many milliseconds: a frame of
   * their own would hold it up.
   */
  drawMarks(wait: number): void {
    if (wait === 0 || this.paces.cloth.way === 0 || this.change !== undefined) {
      this.draw('cloth');
    } else {
      this.laterTimer ??= setTimeout(() => this.draw('cloth'), wait);
    }
  }

  /** Shows something else from now on, in another space. */
  setBounds(bounds: Box3 | undefined): void {
    this.sphere = bounds?.getBoundingSphere(new Sphere());
    this.paces = newPaces();
  }

  /** Moves the camera until a box fills the picture. @param from - Direction to look from; zero: the present one. */
  lookAt(box: Box3, from: Vector3): void {
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

  /** Turns the camera about a point from now on. */
  pivotAt(point: Vector3): void {
    this.controls.target.copy(point);
    this.controls.update();
    this.draw();
  }

  /** What is drawn as a PNG, its background transparent. */
  async picture(): Promise<Blob> {
    this.setShare(1);
    this.drawNow();
    // At once: after this task the browser may have cleared what was drawn.
    const picture = await new Promise<Blob | null>((resolve) => this.canvas.toBlob(resolve, 'image/png'));
    if (picture === null) {
      throw new Error('The browser made no picture.');
    }
    return picture;
  }

  /** Draws everything with the pixels that there are now. */
  drawNow(): void {
    this.stays.forget();
    this.fit();
    const { clientWidth: width, clientHeight: height } = this.host;
    const { before, split: share } = this.drawn.look();
    const split = Math.round(share * width);
    this.renderer.setScissorTest(split > 0);
    this.renderer.setScissor(split, 0, width - split, height);
    this.drawPart(!before);
    if (split > 0) {
      this.renderer.setScissor(0, 0, split, height);
      this.drawPart(false);
    }
  }

  dispose(): void {
    this.forgetFrame?.();
    clearTimeout(this.stillTimer);
    clearTimeout(this.laterTimer);
    this.resized.disconnect();
    this.controls.dispose();
    this.stays.dispose();
    this.renderer.dispose();
    this.canvas.remove();
  }

  /** Draws what has changed: in the way that is fast enough while changes come one after another, and else with all pixels. */
  private drawFrame(change: Change): void {
    const isMoving = this.inFlight > 0 || performance.now() - this.finishedAt < STILL;
    this.change = undefined;
    clearTimeout(this.stillTimer);
    if (!isMoving) {
      this.setShare(1);
      this.drawNow();
      this.whenDrawn(() => {});
      return;
    }
    const { before, split } = this.drawn.look();
    const isCloth = change === 'cloth' && split === 0 && !before;
    const pace = isCloth ? this.paces.cloth : this.paces.camera;
    this.setShare((isCloth ? CLOTH_WAYS : CAMERA_WAYS)[pace.way] ?? 1);
    let isUsual = true;
    if (isCloth && pace.way > 0) {
      this.fit();
      this.renderer.setScissorTest(false);
      isUsual = this.stays.draw(this.renderer, this.camera);
      this.isFull = false;
    } else {
      this.drawNow();
    }
    this.whenDrawn((time) => isUsual && pace.took(time));
  }

  /** Draws with all pixels what was drawn with fewer. */
  private drawStill(): void {
    if (this.change === undefined && !this.isFull) {
      this.finishedAt = Number.NEGATIVE_INFINITY;
      this.draw();
    }
  }

  /**
   * Tells after how many milliseconds what was asked for is drawn; then draws what has changed meanwhile. Without a graphics card the browser itself waits for
   * the pixels, and this page with it: that counts, too.
   */
  private whenDrawn(told: (time: number) => void): void {
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    const start = performance.now();
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    this.inFlight += 1;
    const look = (): void => {
      // A lost context has no fences, and never finishes.
      if (fence !== null && gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) {
        setTimeout(look, LOOK);
        return;
      }
      gl.deleteSync(fence);
      this.inFlight -= 1;
      this.finishedAt = performance.now();
      told(this.finishedAt - start);
      if (this.change !== undefined) {
        this.draw(this.change);
      } else if (!this.isFull) {
        clearTimeout(this.stillTimer);
        this.stillTimer = setTimeout(() => this.drawStill(), STILL);
      }
    };
    setTimeout(look, LOOK);
  }

  private setShare(share: number): void {
    const ratio = share * pixelRatio();
    this.isFull = share === 1;
    if (this.renderer.getPixelRatio() !== ratio) {
      this.renderer.setPixelRatio(ratio);
    }
  }

  private fit(): void {
    this.fitDepth();
    this.drawn.fit(this.host.clientHeight);
  }

  private drawPart(mended: boolean): void {
    this.drawn.arrange(mended);
    this.renderer.render(this.scene, this.camera);
    this.drawn.arrange(true);
  }

  /** Near and far planes that hold everything, whatever its unit. */
  private fitDepth(): void {
    if (this.sphere !== undefined) {
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
      this.setShare(1);
      this.drawNow();
    }
  }
}

function newPaces(): { readonly camera: Pace; readonly cloth: Pace } {
  return { camera: new Pace(CAMERA_WAYS.length), cloth: new Pace(CLOTH_WAYS.length) };
}

/** Pixels of a CSS pixel's side. */
function pixelRatio(): number {
  return Math.min(devicePixelRatio, 2);
}
