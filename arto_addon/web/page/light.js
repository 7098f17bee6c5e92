// Light on the octahedral square: its levels, how they are read, and planes of light on patches.

const SMALLEST = 4;

function directionAt(x, y) {
  x = 2 * x - 1;
  y = 2 * y - 1;
  const z = 1 - Math.abs(x) - Math.abs(y), below = Math.max(-z, 0);
  x -= x < 0 ? -below : below;
  y -= y < 0 ? -below : below;
  const n = Math.hypot(x, y, z);
  return [x / n, y / n, z / n];
}

// All middles of texels, 3 numbers each, and their solid angles.
function square(side) {
  const around = new Float64Array(side * side * 3), omega = new Float64Array(side * side);
  let total = 0;
  for (let j = 0, i = 0; j < side; j++)
    for (let k = 0; k < side; k++, i++) {
      const d = directionAt((k + 0.5) / side, (j + 0.5) / side);
      around.set(d, 3 * i);
      total += omega[i] = (Math.abs(d[0]) + Math.abs(d[1]) + Math.abs(d[2])) ** 3;
    }
  for (let i = 0; i < omega.length; i++) omega[i] *= (4 * Math.PI) / total;
  return { side, around, omega };
}

// The radiance of a world: codes, three pictures -> texels of three numbers.
function radiance(codes, floor, stops) {
  const size = codes.length / 3, out = new Float32Array(codes.length);
  const of = new Float32Array(65536);
  for (let c = 1; c < 65536; c++) of[c] = 2 ** ((c - 1) / stops) * floor;
  for (let c = 0; c < 3; c++)
    for (let i = 0; i < size; i++) out[3 * i + c] = of[codes[c * size + i]];
  return out;
}

function levelsOf(map) {
  let side = Math.sqrt(map.length / 3), omega = square(side).omega;
  const out = [{ side, map }];
  while (side > SMALLEST) {
    const half = side / 2, next = new Float32Array(half * half * 3);
    const weight = new Float64Array(half * half);
    for (let j = 0; j < half; j++)
      for (let i = 0; i < half; i++) {
        const at = j * half + i, from = 2 * j * side + 2 * i;
        let sum = 0, r = 0, g = 0, b = 0;
        for (const k of [from, from + 1, from + side, from + side + 1]) {
          const w = omega[k];
          sum += w;
          r += w * map[3 * k];
          g += w * map[3 * k + 1];
          b += w * map[3 * k + 2];
        }
        weight[at] = sum;
        next[3 * at] = r / sum;
        next[3 * at + 1] = g / sum;
        next[3 * at + 2] = b / sum;
      }
    side = half;
    map = next;
    omega = weight;
    out.push({ side, map });
  }
  return out;
}

function texel(side, i, j) {
  if (i < 0 || i >= side) {
    i = Math.min(Math.max(i, 0), side - 1);
    j = side - 1 - j;
  }
  if (j < 0 || j >= side) {
    i = side - 1 - i;
    j = Math.min(Math.max(j, 0), side - 1);
  }
  return 3 * (j * side + i);
}

// Read a level between its texels, into out[at...].
function readLevel({ side, map }, dx, dy, dz, out, at) {
  const n = Math.abs(dx) + Math.abs(dy) + Math.abs(dz);
  let x = dx / n, y = dy / n;
  if (dz < 0) {
    const u = 1 - Math.abs(y), v = 1 - Math.abs(x);
    x = x < 0 ? -u : u;
    y = y < 0 ? -v : v;
  }
  x = (x * 0.5 + 0.5) * side - 0.5;
  y = (y * 0.5 + 0.5) * side - 0.5;
  const i = Math.floor(x), j = Math.floor(y), fx = x - i, fy = y - j;
  const a = texel(side, i, j), b = texel(side, i + 1, j);
  const c = texel(side, i, j + 1), d = texel(side, i + 1, j + 1);
  for (let k = 0; k < 3; k++)
    out[at + k] =
      (map[a + k] * (1 - fx) + map[b + k] * fx) * (1 - fy) +
      (map[c + k] * (1 - fx) + map[d + k] * fx) * fy;
}

// The patches of a shot: planes of light on them, and what they give the components.
class Patches {
  constructor(shot) {
    const side = shot.shape("patches")[0], frames = shot.arrays.frames;
    const at = shot.arrays.patches, count = frames.length / 9;
    const { around, omega } = square(side);
    Object.assign(this, { side, count, around, omega, at });
    this.u = new Float64Array(at.length);
    this.v = new Float64Array(at.length);
    const gram = new Float64Array(count * 6);
    for (let i = 0; i < at.length; i++) {
      const k = at[i] - 1;
      if (k < 0) continue;
      const [x, y, z] = around.subarray(3 * i, 3 * i + 3), f = 9 * k;
      const dot = (r) => frames[f + r] * x + frames[f + r + 1] * y + frames[f + r + 2] * z;
      const u = (this.u[i] = dot(3) / dot(0)), v = (this.v[i] = dot(6) / dot(0)), w = omega[i];
      [w, w * u, w * v, w * u * u, w * u * v, w * v * v].forEach((t, j) => (gram[6 * k + j] += t));
    }
    // few directions in a row tell no slope: then the level alone counts
    this.inverse = new Float64Array(count * 6);
    for (let k = 0; k < count; k++) {
      const [g, gu, gv, guu, guv, gvv] = gram.subarray(6 * k, 6 * k + 6);
      const n = Math.max(g, 1e-12), mu = gu / n, mv = gv / n;
      const spread = (guu / n - mu * mu) * (gvv / n - mv * mv) - (guv / n - mu * mv) ** 2;
      if (spread < 1e-3 / 144) {
        this.inverse[6 * k] = 1 / n;
        continue;
      }
      const a = guu * gvv - guv * guv, b = guv * gv - gu * gvv, c = gu * guv - guu * gv;
      const det = n * a + gu * b + gv * c;
      const rest = [a, b, c, n * gvv - gv * gv, gu * gv - n * guv, n * guu - gu * gu];
      rest.forEach((t, j) => (this.inverse[6 * k + j] = t / det));
    }
  }

  // What the light gives each of R components: R times three numbers.
  given(levels, turn, toLight, components) {
    const level =
      levels.find((l) => l.side <= Math.max(this.side / 2, SMALLEST)) || levels[levels.length - 1];
    const { around, omega, at, u, v } = this, cos = Math.cos(turn), sin = Math.sin(turn);
    const sums = new Float64Array(this.count * 9), light = new Float64Array(3);
    for (let i = 0; i < at.length; i++) {
      const k = at[i] - 1;
      if (k < 0) continue;
      const x = around[3 * i], y = around[3 * i + 1];
      readLevel(level, cos * x - sin * y, sin * x + cos * y, around[3 * i + 2], light, 0);
      const w = omega[i], s = 9 * k;
      for (let c = 0; c < 3; c++) {
        const t = w * light[c];
        sums[s + c] += t;
        sums[s + 3 + c] += t * u[i];
        sums[s + 6 + c] += t * v[i];
      }
    }
    const out = new Float64Array(3 * components);
    for (let k = 0; k < this.count; k++) {
      const [a, b, c, d, e, f] = this.inverse.subarray(6 * k, 6 * k + 6);
      for (let ch = 0; ch < 3; ch++) {
        const [p, q, r] = [sums[9 * k + ch], sums[9 * k + 3 + ch], sums[9 * k + 6 + ch]];
        const plane = [a * p + b * q + c * r, b * p + d * q + e * r, c * p + e * q + f * r];
        for (let m = 0; m < 3; m++) {
          const row = ((3 * k + m) * 3 + ch) * components, value = plane[m];
          if (value) for (let n = 0; n < components; n++) out[3 * n + ch] += value * toLight[row + n];
        }
      }
    }
    return out;
  }
}
