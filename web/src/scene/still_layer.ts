/** What stays as it is while a hand moves new cloth, drawn once: colours and depths that later frames start from. */
import {
  DepthTexture,
  Mesh,
  NearestFilter,
  NoBlending,
  type PerspectiveCamera,
  PlaneGeometry,
  SRGBColorSpace,
  type Scene,
  ShaderMaterial,
  UnsignedIntType,
  Vector2,
  WebGLRenderTarget,
  type WebGLRenderer,
} from '../vendor.js';

/** Layers of the scene's objects: what stays, what moves with the cloth, and the picture of what stays. */
const STAYS = 0;
export const MOVES = 1;
const PICTURE = 2;

const VERTEX = `
varying vec2 place;
void main() {
  place = uv;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

// The colours are multiplied by their alpha, which must not be when they are coded.
const FRAGMENT = `
uniform sampler2D colors;
uniform sampler2D depths;
varying vec2 place;
void main() {
  vec4 color = texture2D(colors, place);
  gl_FragColor = vec4(color.rgb / max(color.a, 1e-4), color.a);
  #include <colorspace_fragment>
  gl_FragColor.rgb *= color.a;
  gl_FragDepth = texture2D(depths, place).r;
}`;

export class StillLayer {
  private target: WebGLRenderTarget | undefined;
  private isCurrent = false;
  private readonly uniforms = { colors: { value: null as unknown }, depths: { value: null as unknown } };
  private readonly picture: Mesh<PlaneGeometry, ShaderMaterial>;

  constructor(private readonly scene: Scene) {
    const material = new ShaderMaterial({
      uniforms: this.uniforms,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      blending: NoBlending,
    });
    this.picture = new Mesh(new PlaneGeometry(2, 2), material);
    this.picture.layers.set(PICTURE);
    this.picture.frustumCulled = false;
    this.picture.renderOrder = -1;
    scene.add(this.picture);
  }

  /** What it shows has changed. */
  forget(): void {
    this.isCurrent = false;
  }

  /** Draws the scene, what stays only if that has changed. Whether it had not. */
  draw(renderer: WebGLRenderer, camera: PerspectiveCamera): boolean {
    const target = this.targetOf(renderer);
    const wasCurrent = this.isCurrent;
    if (!wasCurrent) {
      camera.layers.set(STAYS);
      renderer.setRenderTarget(target);
      renderer.render(this.scene, camera);
      renderer.setRenderTarget(null);
      this.isCurrent = true;
    }
    camera.layers.set(MOVES);
    camera.layers.enable(PICTURE);
    renderer.render(this.scene, camera);
    showAll(camera);
    return wasCurrent;
  }

  dispose(): void {
    this.target?.dispose();
    this.picture.geometry.dispose();
    this.picture.material.dispose();
  }

  /** A place for as many pixels as are drawn now. */
  private targetOf(renderer: WebGLRenderer): WebGLRenderTarget {
    const { x: width, y: height } = renderer.getDrawingBufferSize(new Vector2());
    if (this.target?.width === width && this.target.height === height) {
      return this.target;
    }
    this.target?.dispose();
    this.isCurrent = false;
    this.target = new WebGLRenderTarget(width, height, {
      samples: 4,
      colorSpace: SRGBColorSpace,
      minFilter: NearestFilter,
      magFilter: NearestFilter,
      depthTexture: new DepthTexture(width, height, UnsignedIntType),
    });
    this.uniforms.colors.value = this.target.texture;
    this.uniforms.depths.value = this.target.depthTexture;
    return this.target;
  }
}

/** A camera that sees what stays and what moves. */
export function showAll(camera: PerspectiveCamera): void {
  camera.layers.set(STAYS);
  camera.layers.enable(MOVES);
}
