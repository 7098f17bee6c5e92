// The file of a shot: its head, and its arrays. docs/web-format.md says all of it.

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Add up differences along rows or columns; the array is changed.
function addUp(out, about) {
  const [height, width] = about.shape.slice(-2);
  const count = out.length / (height * width || 1);
  for (let p = 0; p < count; p++) {
    const begin = p * height * width;
    if (about.delta === "left" || about.delta === "plane")
      for (let y = 0; y < height; y++)
        for (let i = begin + y * width + 1, end = begin + (y + 1) * width; i < end; i++)
          out[i] += out[i - 1];
    if (about.delta === "up" || about.delta === "plane")
      for (let i = begin + width, end = begin + height * width; i < end; i++)
        out[i] += out[i - width];
  }
  if (about.first) {
    const size = out.length / 3;
    for (let i = size; i < out.length; i++) out[i] += out[i % size];
  }
  return out;
}

function halfToFloat(h) {
  const sign = h & 0x8000 ? -1 : 1, exponent = (h >> 10) & 31, part = h & 1023;
  if (exponent === 0) return sign * part * 2 ** -24;
  return sign * (1 + part / 1024) * 2 ** (exponent - 15);
}

function unpacked(raw, about) {
  const size = about.shape.reduce((a, b) => a * b, 1);
  const bytes = { u8: 1, u16: 2, f16: 2, f32: 4 }[about.type];
  if (!bytes || raw.length !== size * bytes) throw new Error("The shot is damaged.");
  if (about.type === "u8") return addUp(raw, about);
  if (about.type === "f32") {
    const whole = new Uint8Array(size * 4);
    for (let i = 0; i < size; i++)
      for (let b = 0; b < 4; b++) whole[4 * i + b] = raw[b * size + i];
    return new Float32Array(whole.buffer);
  }
  if (about.type === "f16")
    return Float32Array.from({ length: size }, (_, i) => halfToFloat(raw[i] | (raw[size + i] << 8)));
  const out = new Uint16Array(size);
  for (let i = 0; i < size; i++) {
    const step = raw[i] | (raw[size + i] << 8);
    out[i] = (step >> 1) ^ -(step & 1);
  }
  return addUp(out, about);
}

async function readShot(buffer) {
  const bytes = new Uint8Array(buffer);
  const mark = String.fromCharCode(...bytes.subarray(0, 7));
  if (mark !== "ARTOWEB" || bytes[7] !== 1) throw new Error("This is no shot of this page.");
  const length = new DataView(buffer).getUint32(8, true);
  const head = JSON.parse(new TextDecoder().decode(bytes.subarray(12, 12 + length)));
  const arrays = {};
  await Promise.all(
    Object.entries(head.arrays).map(async ([name, about]) => {
      const at = 12 + length + about.at;
      arrays[name] = unpacked(await inflated(bytes.subarray(at, at + about.bytes)), about);
    }),
  );
  const [, height, width] = head.arrays.white.shape;
  return { head, arrays, width, height, shape: (name) => head.arrays[name].shape };
}
