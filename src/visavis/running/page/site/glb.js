// Reads people as Visavis writes them in glTF 2.0 (`gltf.exporting`): one skeleton whose joints have no
// turn of their own at rest, meshes bound to it, pictures. Other files are refused.

const JSON_CHUNK = 0x4e4f534a;
const KINDS = { 5120: Int8Array, 5121: Uint8Array, 5122: Int16Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };
const SIZES = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT4: 16 };

/** Return a file's description and what reads an accessor of it by number. */
function opened(buffer) {
  const view = new DataView(buffer);
  const length = view.getUint32(12, true);
  if (view.getUint32(0, true) !== 0x46546c67 || view.getUint32(16, true) !== JSON_CHUNK) throw new Error("a figure's file is no glTF");
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 20, length)));
  const from = 20 + length + 8;
  const bytesOf = (number) => {
    const { byteOffset = 0, byteLength } = json.bufferViews[number];
    return buffer.slice(from + byteOffset, from + byteOffset + byteLength);
  };
  const read = (number) => {
    const { bufferView, componentType, type, count, byteOffset = 0 } = json.accessors[number];
    return new KINDS[componentType](bytesOf(bufferView), byteOffset, count * SIZES[type]);
  };
  return { json, read, bytesOf };
}

async function picturesOf({ json, bytesOf }) {
  let missing = 0;
  const pictures = await Promise.all((json.images || []).map(async ({ bufferView, mimeType }) => {
    try {
      return await createImageBitmap(new Blob([bytesOf(bufferView)], { type: mimeType }), { premultiplyAlpha: "none", colorSpaceConversion: "none" });
    } catch {
      missing += 1;
      return null;
    }
  }));
  if (missing) throw new Error(`${missing} pictures of the figure could not be read`);
  return (json.textures || []).map(({ source }) => pictures[source]);
}

/**
 * Return a person: `rest` (places of joints, three numbers each) and `parts`, each with its arrays,
 * `kind` of material and `picture` (null without one). Colours are bytes of sRGB.
 */
export async function readPerson(buffer) {
  const file = opened(buffer);
  const { json, read } = file;
  const pictures = await picturesOf(file);
  const [skin] = json.skins;
  const inverse = read(skin.inverseBindMatrices);
  const rest = Float32Array.from({ length: 3 * skin.joints.length }, (_, i) => -inverse[16 * Math.floor(i / 3) + 12 + i % 3]);
  const parts = json.meshes.flatMap(({ primitives }) => primitives).map(({ attributes, indices, material }) => {
    const { extras, pbrMetallicRoughness: { baseColorTexture } } = json.materials[material];
    const colour = attributes.COLOR_0 === undefined ? null : read(attributes.COLOR_0);
    return {
      kind: extras.kind,
      picture: baseColorTexture ? pictures[baseColorTexture.index] : null,
      place: read(attributes.POSITION), normal: read(attributes.NORMAL),
      joints: read(attributes.JOINTS_0), weights: read(attributes.WEIGHTS_0),
      uv: attributes.TEXCOORD_0 === undefined ? null : read(attributes.TEXCOORD_0),
      colour: colour && Uint8Array.from(colour, (part) => Math.round(255 * (part / 65535) ** (1 / 2.2))),
      index: read(indices),
    };
  });
  return { rest, parts };
}
