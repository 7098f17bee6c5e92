// The picture: WebGL 2 draws what the light shows. The sums are those of docs/web-format.md.

const VERTEX = `#version 300 es
void main() {
  vec2 p = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0;
  gl_Position = vec4(p, 0.0, 1.0);
}`;

const fragment = (s) => `#version 300 es
precision highp float;
precision highp int;
precision highp usampler2DArray;
precision highp sampler2D;
precision highp sampler3D;
uniform usampler2DArray planes;
uniform sampler2D world;
uniform sampler2D rays;
uniform sampler3D view;
uniform vec3 light[${4 * s.numberLayers}];
uniform vec3 constant;
uniform vec2 turn;
uniform float strength;
uniform float lamps[${Math.max(s.lamps.length, 1)}];
uniform float lampScales[${Math.max(s.lamps.length, 1)}];
uniform bool behind;
uniform bool table;
out vec4 colour;
const float PI = 3.14159265358979;

vec3 light3(uvec3 codes, float scale) {
  vec3 root = vec3(codes) / ${s.codes.full.toFixed(1)};
  return root * root * scale;
}

vec3 unfolded(vec2 p) {
  p = 2.0 * p - 1.0;
  vec3 d = vec3(p, 1.0 - abs(p.x) - abs(p.y));
  float below = max(-d.z, 0.0);
  d.x -= d.x < 0.0 ? -below : below;
  d.y -= d.y < 0.0 ? -below : below;
  return normalize(d);
}

vec3 turned(vec3 d) {
  return vec3(turn.x * d.x - turn.y * d.y, turn.y * d.x + turn.x * d.y, d.z);
}

vec3 texel(int level, int side, ivec2 p) {
  if (p.x < 0 || p.x >= side) { p.x = clamp(p.x, 0, side - 1); p.y = side - 1 - p.y; }
  if (p.y < 0 || p.y >= side) { p.x = side - 1 - p.x; p.y = clamp(p.y, 0, side - 1); }
  return texelFetch(world, p, level).rgb;
}

vec3 readLevel(int level, vec3 d) {
  int side = ${s.side} >> level;
  vec3 q = d / (abs(d.x) + abs(d.y) + abs(d.z));
  vec2 p = q.xy;
  if (q.z < 0.0) {
    vec2 f = 1.0 - abs(q.yx);
    p = vec2(q.x < 0.0 ? -f.x : f.x, q.y < 0.0 ? -f.y : f.y);
  }
  p = (p * 0.5 + 0.5) * float(side) - 0.5;
  ivec2 i = ivec2(floor(p));
  vec2 f = p - vec2(i);
  return mix(mix(texel(level, side, i), texel(level, side, i + ivec2(1, 0)), f.x),
             mix(texel(level, side, i + ivec2(0, 1)), texel(level, side, i + ivec2(1, 1)), f.x), f.y);
}

vec3 look(vec3 d, float width) {
  vec3 around = turned(d);
  float sums = abs(around.x) + abs(around.y) + abs(around.z);
  float size = sums * sqrt(sums) / ${s.side.toFixed(1)};
  float at = clamp(log2(max(width / size, 1e-6)), 0.0, ${(s.levels - 1).toFixed(1)});
  int low = min(int(at), ${s.levels - 2});
  return mix(readLevel(low, around), readLevel(low + 1, around), at - float(low));
}

vec3 lobe(ivec2 p, int layer) {
  uvec4 c = texelFetch(planes, ivec3(p, layer + 1), 0);
  if (c.r + c.g + c.b == 0u) return vec3(0.0);
  uvec4 t = texelFetch(planes, ivec3(p, layer), 0);
  vec3 d = unfolded(vec2(t.xy) / ${s.codes.turns.toFixed(1)});
  float along = ${s.codes.thin} * exp2(float(t.z & 255u) / ${s.codes.steps.toFixed(1)});
  float across = ${s.codes.thin} * exp2(float(t.z >> 8u) / ${s.codes.steps.toFixed(1)});
  float width = max(across, 0.45 * along);
  float apart = sqrt(1.5 * max(along * along - width * width, 0.0));
  float slant = float(t.w) * PI / 256.0;
  float flat_ = length(d.xy);
  vec3 right = flat_ < 1e-4 ? vec3(1, 0, 0) : vec3(-d.y, d.x, 0.0) / flat_;
  vec3 aside = (cos(slant) * right + sin(slant) * cross(d, right)) * apart;
  vec3 sum = look(d, width);
  if (apart > 0.0) sum += look(normalize(d - aside), width) + look(normalize(d + aside), width);
  else sum *= 3.0;
  return light3(c.rgb, ${s.lobeScale}) * sum / 3.0;
}

vec3 ray(vec2 p) {
  ivec2 size = textureSize(rays, 0);
  vec2 at = (p + 0.5) / vec2(${s.width}.0, ${s.height}.0) * vec2(size - 1);
  ivec2 i = min(ivec2(at), size - 2);
  vec2 f = at - vec2(i);
  return normalize(mix(
    mix(texelFetch(rays, i, 0).xyz, texelFetch(rays, i + ivec2(1, 0), 0).xyz, f.x),
    mix(texelFetch(rays, i + ivec2(0, 1), 0).xyz, texelFetch(rays, i + ivec2(1, 1), 0).xyz, f.x),
    f.y));
}

vec3 fromTable(vec3 x) {
  const int last = ${s.tableSide - 1};
  vec3 at = clamp(log2(max(x, 0.0) / 0.18 * 1024.0 + 1.0) / ${Math.log2(2 ** 16.5 + 1)}, 0.0, 1.0)
    * float(last);
  ivec3 low = min(ivec3(at), last - 1);
  vec3 f = at - vec3(low);
  ivec3 a = f.x >= f.y ? (f.x >= f.z ? ivec3(1, 0, 0) : ivec3(0, 0, 1))
                       : (f.y >= f.z ? ivec3(0, 1, 0) : ivec3(0, 0, 1));
  ivec3 c = f.x < f.y ? (f.x < f.z ? ivec3(1, 0, 0) : ivec3(0, 0, 1))
                      : (f.y < f.z ? ivec3(0, 1, 0) : ivec3(0, 0, 1));
  if (a == c) { a = ivec3(1, 0, 0); c = ivec3(0, 0, 1); }
  float high = max(f.x, max(f.y, f.z)), small = min(f.x, min(f.y, f.z));
  float middle = f.x + f.y + f.z - high - small;
  ivec3 one = ivec3(1);
  return texelFetch(view, low, 0).rgb * (1.0 - high)
    + texelFetch(view, low + a, 0).rgb * (high - middle)
    + texelFetch(view, low + one - c, 0).rgb * (middle - small)
    + texelFetch(view, low + one, 0).rgb * small;
}

vec3 shown(vec3 x) {
  if (table) return fromTable(x);
  x = clamp(x, 0.0, 1.0);
  return mix(12.92 * x, 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, x));
}

void main() {
  ivec2 p = ivec2(gl_FragCoord.x, ${s.height} - 1 - int(gl_FragCoord.y));
  vec3 sum = constant;
  for (int i = 0; i < ${s.numberLayers}; i++) {
    vec4 n = vec4(texelFetch(planes, ivec3(p, ${s.firstNumber} + i), 0));
    sum += n.x * light[4 * i] + n.y * light[4 * i + 1]
         + n.z * light[4 * i + 2] + n.w * light[4 * i + 3];
  }
  sum *= light3(texelFetch(planes, ivec3(p, 0), 0).rgb, ${s.whiteScale});
  for (int i = 0; i < ${s.lobes}; i++) sum += lobe(p, 2 + 2 * i);
  sum = max(sum, 0.0);
  vec3 through = vec3(texelFetch(planes, ivec3(p, 1), 0).rgb) / 255.0;
  if (behind && through.r + through.g + through.b > 0.0)
    sum += through * readLevel(0, turned(ray(vec2(p))));
  sum *= strength;
  for (int i = 0; i < ${s.lamps.length}; i++)
    sum += lamps[i] * light3(texelFetch(planes, ivec3(p, ${s.firstLamp} + i), 0).rgb, lampScales[i]);
  colour = vec4(shown(max(sum, 0.0)), 1.0);
}`;

const number = (x) => (Number.isInteger(x) ? x.toFixed(1) : String(x));

class Picture {
  constructor(canvas, shot) {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
    if (!gl) throw new Error("no WebGL 2");
    const { head, arrays, width, height } = shot;
    if (Math.max(width, height) > gl.getParameter(gl.MAX_TEXTURE_SIZE)) throw new Error("too large");
    canvas.width = width;
    canvas.height = height;
    const components = arrays.steps.length, side = shot.shape("world_0")[1];
    const about = {
      width, height, side, components, codes: head.codes, lobes: head.lobes, lamps: head.lamps,
      levels: Math.log2(side / SMALLEST) + 1, numberLayers: Math.ceil(components / 4),
      whiteScale: number(head.scales.white), lobeScale: number(head.scales.lobes),
      tableSide: arrays.view ? shot.shape("view")[0] : 2,
    };
    about.firstLamp = 2 + 2 * about.lobes;
    about.firstNumber = about.firstLamp + about.lamps.length;
    Object.assign(this, { gl, shot, about, canvas });
    this.program = this.build(VERTEX, fragment(about));
    this.at = (name) => gl.getUniformLocation(this.program, name);
    gl.useProgram(this.program);
    ["planes", "world", "rays", "view"].forEach((name, i) => gl.uniform1i(this.at(name), i));
    gl.uniform1i(this.at("table"), arrays.view ? 1 : 0);
    if (about.lamps.length)
      gl.uniform1fv(this.at("lampScales"), about.lamps.map((name) => head.scales[name]));
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    this.putPlanes();
    this.putTables();
    this.patches = new Patches(shot);
    this.world = null;
  }

  build(...sources) {
    const gl = this.gl, program = gl.createProgram();
    sources.forEach((source, i) => {
      const shader = gl.createShader(i ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
        throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    });
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(gl.getProgramInfoLog(program));
    return program;
  }

  texture(unit, target) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(target, gl.createTexture());
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(target, name, gl.NEAREST);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T])
      gl.texParameteri(target, name, gl.CLAMP_TO_EDGE);
  }

  // Everything that a pixel has, in layers of four numbers of 16 bits.
  putPlanes() {
    const { gl, about } = this, { arrays, width, height } = this.shot, n = width * height;
    this.texture(0, gl.TEXTURE_2D_ARRAY);
    const layers = about.firstNumber + about.numberLayers;
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA16UI, width, height, layers);
    const room = new Uint16Array(4 * n);
    const put = (layer, ...parts) => {
      room.fill(0);
      parts.forEach((part, c) => {
        if (part) for (let i = 0; i < n; i++) room[4 * i + c] = part[i];
      });
      gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, layer, width, height, 1,
        gl.RGBA_INTEGER, gl.UNSIGNED_SHORT, room);
    };
    const part = (array, i) => array.subarray(i * n, (i + 1) * n);
    const three = (array) => [0, 1, 2].map((i) => part(array, i));
    put(0, ...three(arrays.white));
    const through = arrays.through;
    put(1, ...(through.length === n ? [through, through, through] : three(through)));
    for (let i = 0; i < about.lobes; i++) {
      const toward = arrays[`lobe_${i}_toward`], shape = arrays[`lobe_${i}_shape`];
      const widths = Uint16Array.from({ length: n }, (_, k) => shape[k] | (shape[n + k] << 8));
      put(2 + 2 * i, part(toward, 0), part(toward, 1), widths, part(shape, 2));
      put(3 + 2 * i, ...three(arrays[`lobe_${i}_colour`]));
    }
    about.lamps.forEach((name, i) => put(about.firstLamp + i, ...three(arrays[`lamps_${name}`])));
    for (let i = 0; i < about.numberLayers; i++)
      put(about.firstNumber + i, ...[0, 1, 2, 3].map((c) =>
        4 * i + c < about.components ? part(arrays.numbers, 4 * i + c) : null));
  }

  putTables() {
    const { gl, shot } = this, { arrays } = shot;
    this.texture(2, gl.TEXTURE_2D);
    const [rows, columns] = shot.shape("rays");
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB32F, columns, rows, 0, gl.RGB, gl.FLOAT, arrays.rays);
    this.texture(3, gl.TEXTURE_3D);
    const side = arrays.view ? shot.shape("view")[0] : 2;
    gl.texImage3D(gl.TEXTURE_3D, 0, gl.RGB8, side, side, side, 0, gl.RGB, gl.UNSIGNED_BYTE,
      arrays.view || new Uint8Array(24));
    this.texture(1, gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST_MIPMAP_NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAX_LEVEL, this.about.levels - 1);
  }

  map(name, about) {
    return radiance(this.shot.arrays[name], about.floor, this.about.codes.stops);
  }

  // Put a world, with its lights, on the square.
  putWorld(dials) {
    const key = JSON.stringify([dials.world, dials.lights]);
    if (this.world === key) return;
    this.world = key;
    const about = this.shot.head.worlds[dials.world], map = this.map(`world_${dials.world}`, about);
    about.lights.forEach((light, i) => {
      const gain = dials.lights[light.name] ?? 1;
      const more = this.map(`world_${dials.world}_light_${i}`, light);
      if (gain) for (let k = 0; k < map.length; k++) map[k] += gain * more[k];
    });
    this.levels = levelsOf(map);
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE1);
    this.levels.forEach(({ side, map: texels }, i) =>
      gl.texImage2D(gl.TEXTURE_2D, i, gl.RGB32F, side, side, 0, gl.RGB, gl.FLOAT, texels));
  }

  draw(dials) {
    const { gl, about } = this, { arrays } = this.shot;
    this.putWorld(dials);
    const n = about.components;
    const given = this.patches.given(this.levels, dials.turn, arrays.to_light, n);
    const light = new Float32Array(12 * about.numberLayers), constant = [0, 0, 0];
    for (let i = 0; i < n; i++)
      for (let c = 0; c < 3; c++) {
        light[3 * i + c] = given[3 * i + c] * arrays.steps[i];
        constant[c] += given[3 * i + c] * arrays.zeros[i];
      }
    gl.uniform3fv(this.at("light"), light);
    gl.uniform3fv(this.at("constant"), constant);
    gl.uniform2f(this.at("turn"), Math.cos(dials.turn), Math.sin(dials.turn));
    gl.uniform1f(this.at("strength"), dials.strength);
    gl.uniform1i(this.at("behind"), dials.behind ? 1 : 0);
    // a group is in the sum of all lamps already
    const gains = about.lamps.map((name) =>
      name === "own" ? dials.own : dials.own * ((dials.groups[name] ?? 1) - 1));
    if (gains.length) gl.uniform1fv(this.at("lamps"), gains);
    gl.viewport(0, 0, about.width, about.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // The pixels that were drawn last, for tests: rows from the top, four bytes each.
  pixels(dials) {
    this.draw(dials);
    const { gl } = this, { width, height } = this.about, raw = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, raw);
    const out = new Uint8Array(raw.length);
    for (let y = 0; y < height; y++)
      out.set(raw.subarray(4 * width * y, 4 * width * (y + 1)), 4 * width * (height - 1 - y));
    return out;
  }
}
