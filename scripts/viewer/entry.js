// What the report's page uses of its libraries; everything else is left out of the bundle.
export {
    AmbientLight,
    BufferAttribute,
    BufferGeometry,
    Color,
    DirectionalLight,
    DoubleSide,
    Group,
    Mesh,
    MeshLambertMaterial,
    MeshPhongMaterial,
    MeshBasicMaterial,
    OrthographicCamera,
    Quaternion,
    Scene,
    SphereGeometry,
    Vector3,
    WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
export { LineMaterial } from "three/addons/lines/LineMaterial.js";
export { LineSegments2 } from "three/addons/lines/LineSegments2.js";
export { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";
export { default as uPlot } from "uplot";
