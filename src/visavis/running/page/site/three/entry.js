export {
  CanvasTexture, CircleGeometry, Color, CustomToneMapping, Fog, HemisphereLight,
  LoadingManager, Mesh, MeshBasicMaterial, MeshLambertMaterial, MeshPhongMaterial, PerspectiveCamera,
  PointLight, RepeatWrapping, Scene, ShaderChunk, SpotLight, SRGBColorSpace,
  WebGLRenderer, REVISION,
} from "three";
export { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
