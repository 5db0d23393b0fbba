// A headset by WebXR as any page has it: whether one can be entered, where one stands in a world, and what
// both eyes see of it. Studies in a headset (headset.js) and sessions seen again in one use it.

const [NEAREST_M, FARTHEST_M] = [0.05, 60];

/** Tell whether this browser can enter a headset, and why not. */
export async function whyNot() {
  if (!window.isSecureContext) return "the address is not secure";
  if (!navigator.xr) return "this browser has no WebXR";
  try {
    return await navigator.xr.isSessionSupported("immersive-vr") ? "" : "no headset is connected";
  } catch (error) {
    return String(error.message || error);
  }
}

/**
 * Enter a headset; to be called from a press of a button. `contextOf` returns what draws, once one may enter;
 * places in `space` are metres from the floor.
 */
export async function openHeadset(contextOf, optionalFeatures = []) {
  const session = await navigator.xr.requestSession("immersive-vr", { requiredFeatures: ["local-floor"], optionalFeatures });
  try {
    await contextOf().makeXRCompatible();
    return { session, space: await session.requestReferenceSpace("local-floor") };
  } catch (error) {
    await session.end();
    throw error;
  }
}

/** Draw into a headset by a context from now on; returns where its pictures go. */
export function drawIn(session, gl) {
  const layer = new XRWebGLLayer(session, gl);
  session.updateRenderState({ baseLayer: layer, depthNear: NEAREST_M, depthFar: FARTHEST_M });
  return layer;
}

export const rotated = ({ x, y, z, w }, [a, b, c]) => {
  const t = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * t[0] + y * t[2] - z * t[1], b + w * t[1] + z * t[0] - x * t[2], c + w * t[2] + x * t[1] - y * t[0]];
};

/** Return the product of two matrices in columns. */
export function product(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c += 1) for (let r = 0; r < 4; r += 1) for (let k = 0; k < 4; k += 1) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return out;
}

// A direction on the floor, of length 1; `other` where it points up or down.
function level([dx, , dz], other) {
  const far = Math.hypot(dx, dz);
  return far > 1e-6 ? [dx / far, dz / far] : other;
}

/**
 * Return how a world lies to the headset's floor. Who stands at `own.at` (floor, metres) and faces `own.ahead`
 * there is at `eye` in the world and faces `aim`, turned about the vertical alone; the floor is `floor_m` high
 * in it. `enter` leads from the world to the floor, `toWorld` back.
 */
export function standAt(eye, aim, own = { at: [0, 0, 0], ahead: [0, 0, -1] }, floor_m = 0) {
  const [fx, fz] = level(aim.map((a, i) => a - eye[i]), [0, -1]);
  const [u, v] = level(own.ahead, [0, -1]);
  const [c, s] = [fx * u + fz * v, fz * u - fx * v];
  const [a, , b] = own.at;
  const toWorld = ([x, y, z]) => [eye[0] + c * (x - a) - s * (z - b), y + floor_m, eye[2] + s * (x - a) + c * (z - b)];
  const enter = new Float32Array([c, 0, -s, 0, 0, 1, 0, 0, s, 0, c, 0, a - c * eye[0] - s * eye[2], -floor_m, b + s * eye[0] - c * eye[2], 1]);
  return { enter, toWorld };
}

/** Return what a pose of the head means for each eye: its part of the picture, its place in the world, its projection. */
export function eyesOf(viewer, layer, stand) {
  return viewer.views.map((view) => {
    const { x, y, width, height } = layer.getViewport(view);
    const at = view.transform.position;
    return { viewport: [x, y, width, height], eye: stand.toWorld([at.x, at.y, at.z]),
      projection: product(product(view.projectionMatrix, view.transform.inverse.matrix), stand.enter) };
  });
}
