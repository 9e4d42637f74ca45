/** Everything that the editor uses of its libraries, in one place: `build.mjs` makes a file of its own of it. */
export { LitElement, css, html, nothing, svg, unsafeCSS } from 'lit';
export type { ReactiveController, TemplateResult } from 'lit';
export { MeshBVH, acceleratedRaycast } from 'three-mesh-bvh';
export {
  AmbientLight,
  Box3,
  BufferAttribute,
  BufferGeometry,
  Color,
  DepthTexture,
  DirectionalLight,
  DoubleSide,
  Group,
  HemisphereLight,
  Line,
  LineBasicMaterial,
  LineLoop,
  MOUSE,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  NearestFilter,
  NoBlending,
  Object3D,
  PerspectiveCamera,
  Plane,
  PlaneGeometry,
  Ray,
  Raycaster,
  SRGBColorSpace,
  Scene,
  ShaderMaterial,
  SphereGeometry,
  Sphere,
  Triangle,
  UnsignedIntType,
  Vector2,
  Vector3,
  WebGLRenderTarget,
  WebGLRenderer,
} from 'three';
export type { Intersection, Material, Texture } from 'three';
export { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
export { Line2 } from 'three/examples/jsm/lines/Line2.js';
export { LineGeometry } from 'three/examples/jsm/lines/LineGeometry.js';
export { LineMaterial } from 'three/examples/jsm/lines/LineMaterial.js';
export { DRACOLoader } from 'three/examples/jsm/loaders/DRACOLoader.js';
export { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
export { MeshoptDecoder } from 'three/examples/jsm/libs/meshopt_decoder.module.js';
