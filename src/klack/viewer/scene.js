// Bodies in three dimensions: mount(element, payload, options) draws what payload.py packed.
// One scene and one WebGL context for each mount; dispose() releases both.
//
// options: theme 'light' or 'dark' (default: that of the system), panel false (bodies and curves alone) or
// copy false (a pick copies nothing), autoplay false.
// mount returns {dispose(), setTime(microseconds), showMode(index, share), on(event, call), state(), probe(body, vertex),
// highlight(name of a face or null), setRoles({name: 'contact' or 'held'}), setTheme(theme), setCut(on), setVisible(body, on)};
// events: 'pick' (name of a face), 'hover' (the same, or null), 'time' (microseconds), 'mode' (index). showMode counts the
// modes of all bodies as they are listed; share is their largest displacement over the overall size.
import * as THREE from './three.min.js';

const STYLE = `
.ks{--ink:#1d2329;--soft:#55606b;--line:#cfd6dd;--panel:#ffffff;--back:#eef1f4;--accent:#0b5c8f;--on:#ffffff;
  color:var(--ink);background:var(--panel);font:14px/1.45 system-ui,"Segoe UI",Roboto,Helvetica,Arial,sans-serif;
  display:grid;grid-template-columns:minmax(0,1fr) 300px;grid-template-rows:minmax(0,1fr) auto;height:100%;min-height:420px;position:relative}
.ks.ks-narrow{grid-template-columns:minmax(0,1fr);grid-template-rows:360px auto auto;height:auto}
.ks.ks-bare{grid-template-columns:minmax(0,1fr)}
.ks.ks-dark{--ink:#e6eaee;--soft:#a9b4bf;--line:#39424c;--panel:#1a1f25;--back:#12161a;--accent:#6cb8ec;--on:#0d1317}
.ks *{box-sizing:border-box}
.ks-view{position:relative;background:var(--back);min-height:280px;overflow:hidden}
.ks-view canvas{display:block;width:100%;height:100%;touch-action:none;outline:none;position:absolute;inset:0}
.ks-view canvas:focus-visible{outline:3px solid var(--accent);outline-offset:-3px}
.ks-over{position:absolute;inset:0;pointer-events:none}
.ks-tip{position:absolute;background:var(--ink);color:var(--panel);padding:3px 8px;border-radius:5px;font-size:13px;white-space:nowrap;
  transform:translate(12px,-130%);max-width:90%}
.ks-dim{position:absolute;transform:translate(-50%,-50%);font-size:12px;padding:1px 5px;border-radius:4px;background:var(--panel);color:var(--ink);
  border:1px solid var(--line);white-space:nowrap;font-variant-numeric:tabular-nums}
.ks-bar{position:absolute;left:14px;bottom:12px;font-size:12px;color:var(--ink)}
.ks-bar i{display:block;height:7px;border:2px solid var(--ink);border-top:0;margin-top:2px}
.ks-axes{position:absolute;right:8px;bottom:8px;width:76px;height:76px}
.ks-axes text{font:600 12px system-ui,sans-serif;fill:var(--ink)}
.ks-legend{position:absolute;right:12px;top:12px;font-size:12px;background:var(--panel);border:1px solid var(--line);border-radius:6px;padding:6px 9px;
  font-variant-numeric:tabular-nums}
.ks-legend canvas{position:static;width:180px;height:10px;display:block;margin:3px 0 2px}
.ks-legend div{display:flex;justify-content:space-between;gap:10px}
.ks-panel{border-left:1px solid var(--line);padding:12px 14px;overflow:auto;grid-row:1/3;grid-column:2;font-size:13.5px}
.ks-narrow .ks-panel{grid-row:auto;grid-column:1;border-left:0;border-top:1px solid var(--line)}
.ks-panel h3{font-size:13px;margin:14px 0 5px;letter-spacing:.01em}
.ks-panel h3:first-child{margin-top:0}
.ks-row{display:flex;flex-wrap:wrap;gap:6px;align-items:center;margin:4px 0}
.ks button,.ks select{font:inherit;color:var(--ink);background:var(--panel);border:1px solid var(--line);border-radius:6px;padding:4px 10px;cursor:pointer;max-width:100%}
.ks button:hover,.ks select:hover{border-color:var(--accent)}
.ks button[aria-pressed=true]{background:var(--accent);border-color:var(--accent);color:var(--on)}
.ks :is(button,select,input,svg):focus-visible{outline:2px solid var(--accent);outline-offset:2px}
.ks label{min-height:26px;display:flex;gap:6px;align-items:center;cursor:pointer}
.ks input[type=range]{width:100%;height:26px;accent-color:var(--accent)}
.ks input[type=checkbox]{accent-color:var(--accent);width:16px;height:16px}
.ks select{width:100%}
.ks-chip{width:13px;height:13px;border-radius:3px;border:1px solid var(--soft);flex:none}
.ks-soft{color:var(--soft);font-size:12.5px;overflow-wrap:anywhere}
.ks-faces{display:flex;flex-wrap:wrap;gap:4px}
.ks-faces button{padding:2px 8px;min-height:26px;font-size:12.5px;overflow-wrap:anywhere;text-align:left}
.ks-faces button.ks-hot,.ks-said-of button.ks-hot{border-color:var(--accent);background:var(--back)}
.ks-faces{flex-direction:column}
.ks-faces div{display:flex;flex-wrap:wrap;gap:2px 7px;align-items:center}
.ks dl{margin:2px 0 6px;font-size:12.5px}
.ks dt{color:var(--soft);float:left;clear:left;margin-right:6px}
.ks .ks-joint{float:none;margin-top:5px;color:inherit;font-weight:600}
.ks dd{margin:0;overflow-wrap:anywhere;font-variant-numeric:tabular-nums}
.ks .ks-joint~dd{overflow-wrap:normal}
.ks-said-of{margin:5px 0;overflow-wrap:anywhere;font-variant-numeric:tabular-nums;font-size:12.5px}
.ks-said-of b{font-weight:600}
.ks-said-of button{padding:0 5px;min-height:24px;font-size:12.5px;overflow-wrap:anywhere}
.ks summary{cursor:pointer;min-height:26px;font-size:12.5px;color:var(--soft)}
.ks summary:focus-visible{outline:2px solid var(--accent);outline-offset:2px}
.ks-centre{position:absolute;width:18px;height:18px;margin:-9px 0 0 -9px}
.ks-row .ks-centre{position:static;margin:0}
.ks-charts{grid-column:1;border-top:1px solid var(--line);display:grid;grid-template-columns:repeat(auto-fit,minmax(min(168px,100%),1fr));background:var(--panel);max-height:46vh;overflow:auto}
.ks-narrow .ks-charts{max-height:none}
.ks-chart{position:relative;min-width:0;padding:6px 6px 0}
.ks-chart svg{width:100%;height:176px;display:block;cursor:crosshair;touch-action:none}
.ks-chart text{fill:var(--soft);font:11.5px system-ui,sans-serif;font-variant-numeric:tabular-nums}
.ks-chart .ks-title{fill:var(--ink);font-weight:600}
.ks-chart .ks-grid{stroke:var(--line);stroke-width:1}
.ks-chart .ks-mark{cursor:pointer}
.ks-cursor{position:absolute;left:6px;top:30px;width:2px;height:118px;background:#d55e00;pointer-events:none;will-change:transform}
.ks-schematic{background:#fff;border-radius:6px;max-width:100%;border:1px solid var(--line)}
.ks-said{position:absolute;left:50%;bottom:16px;transform:translateX(-50%);background:var(--ink);color:var(--panel);border-radius:6px;padding:5px 12px;font-size:13px;max-width:92%}
.ks-net{position:absolute;inset:0;background:#fff;overflow:auto;padding:10px}
.ks.ks-flat{display:flex;flex-direction:column-reverse;height:auto;justify-content:flex-end}
.ks-flat .ks-charts{display:block;max-height:none;border:0;padding:12px 14px}
.ks-flat .ks-panel{border:0}
.ks [hidden]{display:none!important}
`;

const BODY_COLOURS = [['#9db8d2', '#86a8c9'], ['#d8bd95', '#bd9c6b'], ['#a9c6a4', '#86ab80'], ['#c8b3d3', '#a78db6'], ['#c9c9c4', '#a3a39d']];
const CONTACT_COLOUR = '#d55e00', HELD_COLOUR = '#0a7f5f', RING_COLOUR = '#c2185b';
const JOINTS = ['press fit', 'bolts', 'layer'];
const WEIGHED = ['solid', 'volume', 'mass', 'centre of gravity', 'inertia', ...JOINTS, 'doubt'];
const TURN = Math.PI / 180;
const UNNAMED = 65535;
const LEAST_SCHEMATIC = 0.8; // of its size, whose letters have 10 px: a narrow window scrolls instead
const STRESS_DECADES = 3; // of the colours: the contact has a hundred times the stress of the rest

// viridis as a polynomial (M. Zucker, CC0): the same coefficients in the shader and in the legend
const VIRIDIS = [
  [0.2777273272, 0.0054073445, 0.3340998053], [0.1050930431, 1.4046135299, 1.3845901626],
  [-0.3308618287, 0.2148475595, 0.0950951631], [-4.6342304988, -5.7991009734, -19.3324409563],
  [6.2282699363, 14.1799333668, 56.6905526007], [4.7763849983, -13.7451453777, -65.3530326334],
  [-5.4354558559, 4.6458526122, 26.3124352496]];
const VIRIDIS_GLSL = 'vec3 viridis(float t){' + VIRIDIS.slice().reverse().reduce(
  (inner, c) => `vec3(${c.map(x => x.toFixed(10)).join(',')})` + (inner ? `+t*(${inner})` : ''), '').replace(/^/, 'return ') + ';}';

const MOVED = `
attribute vec3 shape; uniform float amount; uniform float rigid; uniform float spread;
vec3 moved(){ return position + amount * shape + vec3(0., 0., rigid); }`;

const SURFACE_VERTEX = `${MOVED}
attribute float face; attribute float held; attribute float value; attribute float role;
varying vec3 vNormal; varying vec3 vPlace; varying float vFace; varying float vHeld; varying float vValue; varying float vMove; varying float vRole;
void main(){
  vPlace = position; vFace = face; vHeld = held; vValue = value; vRole = role; vMove = length(shape) * spread;
  vNormal = normalize(mat3(modelViewMatrix) * normal);
  gl_Position = projectionMatrix * modelViewMatrix * vec4(moved(), 1.);
}`;

const SURFACE_FRAGMENT = `
uniform vec3 colour; uniform vec3 contact; uniform vec3 fixedColour; uniform float hover; uniform float cut; uniform float paint;
uniform float marks; uniform float dark;
varying vec3 vNormal; varying vec3 vPlace; varying float vFace; varying float vHeld; varying float vValue; varying float vMove; varying float vRole;
${VIRIDIS_GLSL}
void main(){
  if (cut > .5 && vPlace.y < 0.) discard;
  vec3 base = colour;
  float stripe = step(.5, fract((gl_FragCoord.x + gl_FragCoord.y) / 9.));
  if (!gl_FrontFacing) {
    // a closed body cut by a plane: where its inside is seen first, the plane cuts it
    float hatch = step(.86, fract((gl_FragCoord.x - gl_FragCoord.y) / 8.));
    gl_FragColor = vec4(mix(colour * .86, colour * .60, hatch), 1.);
    return;
  }
  if (paint > 1.5) base = viridis(clamp(vValue, 0., 1.));
  else if (paint > .5) base = viridis(clamp(vMove, 0., 1.));
  else {
    if (vRole > .99) base = mix(base, contact, .82 * marks);
    if (vHeld > .99 && marks > .5) base = mix(base, fixedColour, .45 + .45 * stripe);
  }
  vec3 n = normalize(vNormal);
  float light = .60 + .44 * max(dot(n, vec3(-.448, .647, .617)), 0.) + .16 * max(dot(n, vec3(.792, -.226, .566)), 0.);
  float rim = 1. - max(n.z, 0.); rim *= rim * rim;
  base *= light;
  base = mix(base, vec3(dark > .5 ? .92 : .25), .10 * rim);
  if (hover >= 0. && abs(hover - vFace) < .25) base = mix(base, vec3(1.), .38);
  gl_FragColor = vec4(base, 1.);
}`;

const LINE_VERTEX = `${MOVED}
varying vec3 vPlace; varying float vFacing;
void main(){
  vPlace = position; vFacing = 1.;
#ifdef FACING
  vFacing = (mat3(modelViewMatrix) * normal).z;
#endif
  gl_Position = projectionMatrix * modelViewMatrix * vec4(moved(), 1.); gl_Position.z -= 2e-4;
}`;
const LINE_FRAGMENT = `
uniform vec3 colour; uniform float cut; uniform float alpha; varying vec3 vPlace; varying float vFacing;
void main(){ if (vFacing < -.02) discard; if (cut > .5 && vPlace.y < -1e-6) discard; gl_FragColor = vec4(colour, alpha); }`;

const RING_VERTEX = `
attribute vec3 away; uniform float width; varying vec3 vPlace; varying float vFacing;
void main(){ vPlace = position; vFacing = 1.; gl_Position = projectionMatrix * modelViewMatrix * vec4(position + width * away, 1.); gl_Position.z -= 1e-3; }`;

const KINDS = {f4: Float32Array, i2: Int16Array, i1: Int8Array, u1: Uint8Array, u2: Uint16Array, u4: Uint32Array};

function array(packed) {
  const text = atob(packed.data), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new KINDS[packed.type](bytes.buffer);
}

function rgb(hex) {
  return new THREE.Vector3(...[1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16) / 255));
}

function el(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === 'text') node.textContent = value;
    else if (key.startsWith('on')) node.addEventListener(key.slice(2), value);
    else if (value !== null && value !== undefined) node.setAttribute(key, value);
  }
  node.append(...children.filter(Boolean));
  return node;
}

function svgEl(name, attributes = {}, text) {
  const node = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== undefined) node.textContent = text;
  return node;
}

export function number(value, digits = 3) {
  if (value === 0) return '0';
  if (!Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) {
    const [mantissa, power] = value.toExponential(digits - 1).split('e');
    return `${Number(mantissa)}e${Number(power)}`;
  }
  return String(Number(value.toPrecision(digits)));
}

function millimetres(value) {
  return Math.abs(value) < 0.0995 ? `${number(value * 1e3)} µm` : `${number(value, 4)} mm`;
}

function hertz(value) {
  return value >= 1e3 ? `${number(value / 1e3, 4)} kHz` : `${number(value, 4)} Hz`;
}

// ---------------------------------------------------------------------------------------- motion

// Displacements of the vertices of one body, in mm: sums of its shapes.
class Motion {
  constructor(packed, vertices) {
    this.node = array(packed.node);
    this.angle = array(packed.angle);
    this.shapes = array(packed.shapes);
    this.scale = array(packed.scale);
    this.frequency = packed.frequency;
    this.amplitude = array(packed.amplitude);
    this.stress = array(packed.stress);
    [this.count, this.nodes, this.dimension] = packed.shapes.shape;
    this.frames = packed.amplitude.shape[0] || 0;
    this.sum = new Float32Array(this.nodes * this.dimension);
    this.vertices = vertices;
    if (this.dimension === 2) {
      this.cos = Float32Array.from(this.angle, Math.cos);
      this.sin = Float32Array.from(this.angle, Math.sin);
    }
  }

  get elastic() {
    const out = [];
    this.frequency.forEach((f, i) => { if (f) out.push(i); });
    return out;
  }

  // shape k of size 1 at its largest node
  mode(k, target) {
    const size = this.nodes * this.dimension, first = k * size;
    for (let i = 0; i < size; i++) this.sum[i] = this.shapes[first + i];
    let most = 0;
    for (let n = 0; n < this.nodes; n++) {
      let square = 0;
      for (let d = 0; d < this.dimension; d++) square += this.sum[n * this.dimension + d] ** 2;
      most = Math.max(most, square);
    }
    const factor = most > 0 ? 1 / Math.sqrt(most) : 0;
    for (let i = 0; i < size; i++) this.sum[i] *= factor;
    this.spread(target);
  }

  // displacement between two frames; rigid shapes only where wanted
  at(frame, withRigid, target) {
    const low = Math.min(Math.floor(frame), this.frames - 1), high = Math.min(low + 1, this.frames - 1), part = frame - low;
    const size = this.nodes * this.dimension, sum = this.sum;
    sum.fill(0);
    for (let k = 0; k < this.count; k++) {
      if (!withRigid && this.frequency[k] === 0) continue;
      const a = (1 - part) * this.amplitude[low * this.count + k] + part * this.amplitude[high * this.count + k];
      const factor = a * this.scale[k] / 32767;
      if (factor === 0) continue;
      const first = k * size, shapes = this.shapes;
      for (let i = 0; i < size; i++) sum[i] += factor * shapes[first + i];
    }
    this.spread(target);
  }

  spread(target) {
    const {sum, node, vertices} = this;
    if (this.dimension === 3) {
      for (let v = 0; v < vertices; v++) {
        const n = 3 * node[v];
        target[3 * v] = sum[n]; target[3 * v + 1] = sum[n + 1]; target[3 * v + 2] = sum[n + 2];
      }
    } else {
      for (let v = 0; v < vertices; v++) {
        const n = 2 * node[v];
        target[3 * v] = sum[n] * this.cos[v]; target[3 * v + 1] = sum[n] * this.sin[v]; target[3 * v + 2] = sum[n + 1];
      }
    }
  }
}

function largest(vectors) {
  let most = 0;
  for (let i = 0; i < vectors.length; i += 3) most = Math.max(most, vectors[i] ** 2 + vectors[i + 1] ** 2 + vectors[i + 2] ** 2);
  return Math.sqrt(most);
}

// ---------------------------------------------------------------------------------------- bodies

class Body {
  constructor(packed, index, payload) {
    this.name = packed.name;
    this.packed = packed;
    this.faces = packed.faces;
    this.points = array(packed.points);
    this.face = array(packed.face);
    const vertices = this.points.length / 3;
    this.shape = new Float32Array(3 * vertices);
    this.travel = array(packed.travel);
    this.motion = packed.motion ? new Motion(packed.motion, vertices) : null;
    const held = array(packed.held), value = new Float32Array(vertices);
    this.stress = 0;
    if (this.motion && this.motion.stress.length) {
      for (const s of this.motion.stress) this.stress = Math.max(this.stress, s);
      for (let v = 0; v < vertices; v++) value[v] = this.motion.stress[this.motion.node[v]];
    }
    this.value = value;
    const position = new THREE.BufferAttribute(this.points, 3);
    this.shapeAttribute = new THREE.BufferAttribute(this.shape, 3);
    this.shapeAttribute.setUsage(THREE.DynamicDrawUsage);
    this.valueAttribute = new THREE.BufferAttribute(value, 1);
    const shared = {position, shape: this.shapeAttribute, normal: new THREE.BufferAttribute(array(packed.normals), 3, true)};
    const pair = [];
    for (const contact of payload.contacts) for (const side of [contact.upper, contact.lower]) {
      const place = side.startsWith(this.name + '.') ? this.faces.indexOf(side.slice(this.name.length + 1)) : -1;
      if (place >= 0) pair.push(place);
    }
    this.pair = pair;
    this.uniforms = {amount: {value: 0}, rigid: {value: 0}, spread: {value: 0}, cut: {value: 0}, hover: {value: -1}, paint: {value: 0}, marks: {value: 1},
      dark: {value: 0}, colour: {value: rgb(BODY_COLOURS[index % BODY_COLOURS.length][0])}, contact: {value: rgb(CONTACT_COLOUR)},
      fixedColour: {value: rgb(HELD_COLOUR)}};
    const geometry = new THREE.BufferGeometry();
    for (const [name, attribute] of Object.entries(shared)) geometry.setAttribute(name, attribute);
    geometry.setAttribute('normal', shared.normal);
    geometry.setAttribute('face', new THREE.BufferAttribute(Float32Array.from(this.face), 1));
    geometry.setAttribute('held', new THREE.BufferAttribute(Float32Array.from(held), 1));
    geometry.setAttribute('value', this.valueAttribute);
    geometry.setAttribute('role', new THREE.BufferAttribute(Float32Array.from(this.face, f => pair.includes(f) ? 1 : 0), 1));
    geometry.setIndex(new THREE.BufferAttribute(array(packed.triangles), 1));
    geometry.computeBoundingSphere();
    geometry.computeBoundingBox();
    this.surface = new THREE.Mesh(geometry, new THREE.ShaderMaterial({uniforms: this.uniforms, vertexShader: SURFACE_VERTEX, fragmentShader: SURFACE_FRAGMENT,
      side: THREE.FrontSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1}));
    this.lineColour = {value: rgb('#222a31')};
    this.lines = ['creases', 'elementEdges'].map((key, i) => {
      const own = new THREE.BufferGeometry();
      for (const [name, attribute] of Object.entries(shared)) own.setAttribute(name, attribute);
      own.setIndex(new THREE.BufferAttribute(array(packed[key]), 1));
      own.boundingSphere = geometry.boundingSphere;
      return new THREE.LineSegments(own, this.lineMaterial(i ? 0.42 : 0.9, {FACING: 1}));
    });
    const section = new THREE.BufferGeometry(), places = array(packed.section);
    section.setAttribute('position', new THREE.BufferAttribute(places, 3));
    section.setAttribute('shape', new THREE.BufferAttribute(new Float32Array(places.length), 3));
    this.section = new THREE.LineSegments(section, this.lineMaterial(0.6));
    this.group = new THREE.Group();
    this.group.add(this.surface, ...this.lines, this.section);
    for (const part of this.group.children) part.frustumCulled = false;
  }

  lineMaterial(alpha, defines = {}) {
    const {amount, rigid, spread, cut} = this.uniforms;
    return new THREE.ShaderMaterial({defines, uniforms: {amount, rigid, spread, cut, colour: this.lineColour, alpha: {value: alpha}},
      vertexShader: LINE_VERTEX, fragmentShader: LINE_FRAGMENT, transparent: true, depthWrite: false});
  }

  dispose() {
    for (const part of this.group.children) { part.geometry.dispose(); part.material.dispose(); }
  }
}

function ringMesh(points, closed) {
  const count = points.length / 3, position = [], away = [], index = [], around = 8;
  if (!count) return null;
  const at = i => new THREE.Vector3(points[3 * i], points[3 * i + 1], points[3 * i + 2]);
  const up = new THREE.Vector3(0, 0, 1);
  const corners = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
  // points in one spot, or on some pads, are no line: a small octahedron each
  for (let i = 0; !closed && i < count; i++) {
    const p = at(i);
    for (const corner of corners) { position.push(p.x, p.y, p.z); away.push(...corner); }
    for (const x of [0, 1]) for (const y of [2, 3]) for (const z of [4, 5]) index.push(6 * i + x, 6 * i + y, 6 * i + z);
  }
  for (let i = 0; closed && i < count; i++) {
    const p = at(i), along = at((i + 1) % count).sub(at((i + count - 1) % count)).normalize();
    const out = new THREE.Vector3().crossVectors(along, up).normalize();
    for (let k = 0; k < around; k++) {
      const a = 2 * Math.PI * k / around, n = out.clone().multiplyScalar(Math.cos(a)).addScaledVector(up, Math.sin(a));
      position.push(p.x, p.y, p.z); away.push(n.x, n.y, n.z);
    }
  }
  for (let i = 0; closed && i < count; i++) for (let k = 0; k < around; k++) {
    const a = i * around + k, b = i * around + (k + 1) % around, c = ((i + 1) % count) * around + k, d = ((i + 1) % count) * around + (k + 1) % around;
    index.push(a, b, d, a, d, c);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.Float32BufferAttribute(position, 3));
  geometry.setAttribute('away', new THREE.Float32BufferAttribute(away, 3));
  geometry.setIndex(index);
  const material = new THREE.ShaderMaterial({vertexShader: RING_VERTEX, fragmentShader: LINE_FRAGMENT, side: THREE.DoubleSide, depthTest: false, transparent: true,
    uniforms: {width: {value: 1}, colour: {value: rgb(RING_COLOUR)}, cut: {value: 0}, alpha: {value: 1}}});
  const mesh = new THREE.Mesh(geometry, material);
  mesh.frustumCulled = false;
  mesh.renderOrder = 5;
  return mesh;
}

// the sign of drawings: a disc in quarters, with a rim in the colour of its body
function centreSign(colour) {
  const sign = svgEl('svg', {class: 'ks-centre', viewBox: '-9 -9 18 18', 'aria-hidden': 'true'});
  sign.append(svgEl('circle', {r: 7, fill: '#ffffff', stroke: '#111418', 'stroke-width': 3.4}), svgEl('circle', {r: 7, fill: 'none', stroke: colour, 'stroke-width': 1.6}),
    svgEl('path', {d: 'M0 0V-5.6A5.6 5.6 0 0 1 5.6 0ZM0 0V5.6A5.6 5.6 0 0 1-5.6 0Z', fill: '#111418'}));
  return sign;
}

// ---------------------------------------------------------------------------------------- charts

class Chart {
  constructor(title, curves, {logarithmic = false, xUnit, yUnit, label}) {
    this.label = label;
    this.curves = curves; this.logarithmic = logarithmic; this.xUnit = xUnit; this.yUnit = yUnit; this.title = title;
    this.svg = svgEl('svg', {tabindex: 0, role: 'slider', 'aria-label': label, 'aria-valuemin': 0, 'aria-valuemax': 1, 'aria-valuenow': 0});
    this.line = el('i', {class: 'ks-cursor', hidden: ''});
    this.node = el('div', {class: 'ks-chart'}, this.svg, this.line);
    this.cursor = null; this.marks = [];
  }

  draw() {
    const {svg, curves} = this, width = Math.max(svg.clientWidth, 160), height = 176;
    this.width = width;
    const forward = this.logarithmic ? Math.log10 : x => x;
    svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
    svg.replaceChildren();
    const rows = this.writeTitle(width);
    const box = this.box = {left: 46, right: width - 12, top: 10 + 14 * rows, bottom: height - 34};
    Object.assign(this.line.style, {top: `${box.top + 6}px`, height: `${box.bottom - box.top}px`});
    let x0 = Infinity, x1 = -Infinity, y0 = Infinity, y1 = -Infinity;
    for (const c of curves) for (let i = 0; i < c.x.length; i++) {
      const y = forward(c.y[i]);
      if (!Number.isFinite(y)) continue;
      x0 = Math.min(x0, forward(c.x[i])); x1 = Math.max(x1, forward(c.x[i])); y0 = Math.min(y0, y); y1 = Math.max(y1, y);
    }
    if (!(y1 > y0)) { y0 -= 1; y1 += 1; }
    if (!this.logarithmic) { const pad = 0.06 * (y1 - y0); y0 -= y0 < 0 ? pad : 0; y1 += pad; }
    this.x = v => box.left + (forward(v) - x0) / (x1 - x0) * (box.right - box.left);
    this.y = v => box.bottom - (forward(v) - y0) / (y1 - y0) * (box.bottom - box.top);
    this.back = px => { const t = x0 + (px - box.left) / (box.right - box.left) * (x1 - x0); return this.logarithmic ? 10 ** t : t; };
    for (const [low, high, vertical] of [[x0, x1, true], [y0, y1, false]]) for (const tick of this.ticks(low, high, vertical ? width / 64 : 4)) {
      const value = this.logarithmic ? 10 ** tick : tick, at = vertical ? this.x(value) : this.y(value);
      svg.append(svgEl('line', vertical ? {x1: at, x2: at, y1: box.top, y2: box.bottom, class: 'ks-grid'} : {x1: box.left, x2: box.right, y1: at, y2: at, class: 'ks-grid'}));
      svg.append(svgEl('text', vertical ? {x: at, y: box.bottom + 14, 'text-anchor': 'middle'} : {x: box.left - 5, y: at + 4, 'text-anchor': 'end'}, number(value)));
    }
    svg.append(svgEl('text', {x: box.right, y: height - 5, 'text-anchor': 'end'}, this.xUnit));
    curves.forEach((c, k) => {
      const parts = [];
      for (let i = 0; i < c.x.length; i++) if (Number.isFinite(forward(c.y[i]))) parts.push(`${this.x(c.x[i]).toFixed(1)},${this.y(c.y[i]).toFixed(1)}`);
      svg.append(svgEl('polyline', {points: parts.join(' '), fill: 'none', stroke: k ? '#d55e00' : 'var(--accent)', 'stroke-width': 1.8,
        'stroke-dasharray': k ? '6 4' : 'none'}));
    });
    for (const mark of this.marks) {
      const at = this.x(mark.x);
      if (at < box.left - 1 || at > box.right + 1) continue;
      const dot = svgEl('circle', {cx: at, cy: this.y(mark.y), r: mark.chosen ? 7 : 4.5, class: 'ks-mark', fill: mark.chosen ? '#d55e00' : 'var(--panel)',
        stroke: mark.chosen ? '#d55e00' : 'var(--accent)', 'stroke-width': 1.8});
      dot.append(svgEl('title', {}, mark.text));
      svg.append(dot);
    }
    this.moveCursor(this.cursor);
    this.describe();
  }

  // one row, or where that is too long name and unit below each other; the number of rows
  writeTitle(width) {
    const whole = svgEl('text', {x: 4, y: 15, class: 'ks-title'}, `${this.title} [${this.yUnit}]`);
    this.svg.append(whole);
    if (whole.getComputedTextLength() <= width - 8) return 1;
    whole.textContent = this.title;
    for (let kept = this.title.length - 1; kept > 3 && whole.getComputedTextLength() > width - 8; kept--) whole.textContent = this.title.slice(0, kept) + '…';
    if (whole.textContent !== this.title) whole.append(svgEl('title', {}, this.title));
    this.svg.append(svgEl('text', {x: 4, y: 29, class: 'ks-title'}, `[${this.yUnit}]`));
    return 2;
  }

  // what a screen reader tells of it: where the first curve is highest
  describe() {
    const {x, y} = this.curves[0];
    let top = -1;
    for (let i = 0; i < x.length; i++) if (Number.isFinite(y[i]) && !(y[i] <= y[top])) top = i;
    const told = top < 0 ? '' : `; highest ${number(y[top])} ${this.yUnit} at ${number(x[top])} ${this.xUnit}`;
    this.svg.setAttribute('aria-label', this.label + told);
  }

  moveCursor(value) {
    this.cursor = value;
    const {x} = this.curves[0], first = x[0], last = x[x.length - 1];
    this.svg.setAttribute('aria-valuenow', value === null ? 0 : ((value - first) / (last - first)).toFixed(3));
    this.svg.setAttribute('aria-valuetext', value === null ? 'no cursor' : `${number(value)} ${this.xUnit}`);
    this.line.hidden = value === null;
    if (value !== null && this.x) this.line.style.transform = `translateX(${this.x(value) * this.svg.clientWidth / this.width}px)`;
  }

  ticks(low, high, most) {
    const out = [];
    if (this.logarithmic) {
      for (let p = Math.ceil(low - 1e-9); p <= high + 1e-9; p++) out.push(p);
      const every = Math.ceil(out.length / most);
      if (out.length < 2) return this.linear(low, high, 3);
      return out.filter((_, i) => i % every === 0);
    }
    return this.linear(low, high, most);
  }

  linear(low, high, most) {
    const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].map(f => f * power).find(s => s >= raw);
    const out = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high * (1 + 1e-9) + 1e-12; k++) out.push(k * step);
    return out;
  }
}

// ---------------------------------------------------------------------------------------- mount

export function mount(element, payload, options = {}) {
  return new SceneView(element, payload, options).handle();
}

class SceneView {
  constructor(element, payload, options) {
    this.payload = payload; this.options = options;
    this.listeners = {pick: [], hover: [], time: [], mode: []};
    this.undo = [];
    this.frames = 0;
    this.state = {motion: 'still', mode: null, time: 0, share: 0.08, factor: 1, playing: false, rigid: true};
    this.root = el('section', {class: options.panel === false ? 'ks ks-bare' : 'ks', 'aria-label': `Bodies of ${payload.title}`});
    this.root.append(el('style', {text: STYLE}));
    this.view = el('div', {class: 'ks-view'});
    this.panel = el('div', {class: 'ks-panel'});
    this.chartBox = el('div', {class: 'ks-charts'});
    this.root.append(this.view, this.panel, this.chartBox);
    if (options.panel === false) this.panel.hidden = true;
    element.replaceChildren(this.root);
    this.bodies = payload.bodies.map((b, i) => new Body(b, i, payload));
    this.times = array(payload.time);
    this.buildScene();
    this.buildPanel();
    this.buildCharts();
    this.follow();
    this.setTheme();
    this.whole();
  }

  handle() {
    return {
      dispose: () => this.dispose(),
      setTime: t => this.setTime(t),
      showMode: (i, magnification) => this.showMode(i, magnification),
      on: (event, call) => { (this.listeners[event] ||= []).push(call); },
      probe: (body, vertex) => this.probe(body, vertex),
      highlight: name => this.hover(this.hitOf(name)),
      setRoles: roles => this.setRoles(roles),
      setTheme: theme => { this.options.theme = theme; this.applyTheme(); },
      setCut: on => this.setCut(on),
      setVisible: (name, on) => {
        for (const body of this.bodies) if (body.name === name) body.group.visible = on;
        this.invalidate();
      },
      state: () => ({...this.state, frames: this.frames, modes: this.modes.length, hasScene: Boolean(this.renderer)}),
    };
  }

  listen(target, event, call, more) {
    target.addEventListener(event, call, more);
    this.undo.push(() => target.removeEventListener(event, call, more));
  }

  emit(event, value) {
    for (const call of this.listeners[event] ?? []) call(value);
  }

  // ---- scene

  buildScene() {
    this.canvas = el('canvas', {tabindex: 0, role: 'img', 'aria-label': 'Bodies in three dimensions. Arrow keys rotate, plus and minus zoom, 0 shows everything.'});
    this.over = el('div', {class: 'ks-over'});
    this.tip = el('div', {class: 'ks-tip', hidden: ''});
    this.said = el('div', {class: 'ks-said', role: 'status', hidden: ''});
    this.bar = el('div', {class: 'ks-bar'}, el('span'), el('i'));
    this.axes = svgEl('svg', {class: 'ks-axes', viewBox: '-38 -38 76 76', 'aria-hidden': 'true'});
    this.legend = el('div', {class: 'ks-legend', hidden: ''}, el('span'), el('canvas', {width: 180, height: 1}), el('div', {}, el('span'), el('span')));
    this.centres = this.bodies.map((body, i) => ({body, sign: centreSign(BODY_COLOURS[i % BODY_COLOURS.length][0])})).filter(({body}) => body.packed.centre);
    this.over.append(...this.centres.map(({sign}) => sign), this.bar, this.axes, this.legend, this.tip, this.said);
    this.view.append(this.canvas, this.over);
    this.world = new THREE.Scene();
    for (const body of this.bodies) this.world.add(body.group);
    this.rings = [];
    for (const contact of this.payload.contacts) {
      const ring = ringMesh(array(contact.ring), contact.closed);
      if (ring) { this.rings.push(ring); this.world.add(ring); }
    }
    this.extent = new THREE.Box3();
    for (const body of this.bodies) this.extent.union(body.surface.geometry.boundingBox);
    if (this.extent.isEmpty()) this.extent.set(new THREE.Vector3(-1, -1, -1), new THREE.Vector3(1, 1, 1));
    this.size = this.extent.getSize(new THREE.Vector3()).length();
    this.buildDimensions();
    this.camera = new THREE.OrthographicCamera(-1, 1, 1, -1, -10 * this.size, 10 * this.size);
    this.camera.up.set(0, 0, 1);
    if (!this.bodies.length) { this.view.hidden = true; return; }
    const context = this.context();
    if (!context) {
      this.over.append(el('p', {class: 'ks-said', text: 'This browser has no WebGL 2: the bodies cannot be drawn. Names of faces and numbers are listed next to it.'}));
      this.renderer = null;
      return;
    }
    this.renderer = new THREE.WebGLRenderer({canvas: this.canvas, context});
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = false;
    this.controls.minZoom = 0.3; this.controls.maxZoom = 3000;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener('change', () => this.invalidate());
    this.ray = new THREE.Raycaster();
    this.listen(this.canvas, 'pointermove', e => { this.pointer = e; this.invalidate(); });
    this.listen(this.canvas, 'pointerleave', () => { this.pointer = null; this.hover(null); this.tellHover(null); });
    this.listen(this.canvas, 'pointerdown', e => { this.pressed = [e.clientX, e.clientY]; });
    this.listen(this.canvas, 'click', e => {
      if (this.pressed && Math.hypot(e.clientX - this.pressed[0], e.clientY - this.pressed[1]) > 4) return;
      const name = this.nameAt(e);
      if (name) this.pick(name);
    });
    this.listen(this.canvas, 'keydown', e => this.key(e));
  }

  // a software renderer has no time for antialiasing: it draws a finer picture when all is still
  context() {
    const first = this.canvas.getContext('webgl2', {antialias: true});
    if (!first) return null;
    const info = first.getExtension('WEBGL_debug_renderer_info');
    this.isSlow = /swiftshader|llvmpipe|softpipe|software/i.test(first.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : first.RENDERER));
    if (!this.isSlow) return first;
    first.getExtension('WEBGL_lose_context')?.loseContext();
    const fresh = this.canvas.cloneNode();
    this.canvas.replaceWith(fresh);
    this.canvas = fresh;
    return fresh.getContext('webgl2', {antialias: false});
  }

  buildDimensions() {
    const {min, max} = this.extent, size = this.extent.getSize(new THREE.Vector3()), gap = 0.04 * this.size;
    const lines = [
      [[min.x, min.y - gap, min.z], [max.x, min.y - gap, min.z], size.x, 'x'],
      [[max.x + gap, min.y, min.z], [max.x + gap, max.y, min.z], size.y, 'y'],
      [[min.x - gap, min.y - gap, min.z], [min.x - gap, min.y - gap, max.z], size.z, 'z']];
    const places = [];
    this.dimensions = [];
    for (const [a, b, length, axis] of lines) {
      places.push(...a, ...b);
      const label = el('div', {class: 'ks-dim', text: `${number(length, 4)} mm`, title: axis});
      this.over.append(label);
      this.dimensions.push({label, at: new THREE.Vector3((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2)});
      // small cross bars at both ends
      const bar = 0.012 * this.size, across = axis === 'z' ? [bar, 0, 0] : [0, 0, bar];
      for (const end of [a, b]) places.push(...end.map((v, i) => v - across[i]), ...end.map((v, i) => v + across[i]));
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.Float32BufferAttribute(places, 3));
    geometry.setAttribute('shape', new THREE.Float32BufferAttribute(new Float32Array(places.length), 3));
    this.dimensionColour = {value: rgb('#55606b')};
    const zero = {value: 0};
    this.dimensionLines = new THREE.LineSegments(geometry, new THREE.ShaderMaterial({vertexShader: LINE_VERTEX, fragmentShader: LINE_FRAGMENT, transparent: true,
      uniforms: {amount: zero, rigid: zero, spread: zero, cut: zero, colour: this.dimensionColour, alpha: {value: 1}}}));
    this.dimensionLines.frustumCulled = false;
    this.world.add(this.dimensionLines);
  }

  setTheme() {
    const media = window.matchMedia('(prefers-color-scheme: dark)');
    const apply = this.applyTheme = () => {
      if (this.gone) return;
      const dark = this.options.theme ? this.options.theme === 'dark' : media.matches;
      this.root.classList.toggle('ks-dark', dark);
      for (const body of this.bodies) {
        body.lineColour.value.copy(rgb(dark ? '#0b0e11' : '#222a31'));
        body.uniforms.dark.value = dark ? 1 : 0;
      }
      this.dimensionColour.value.copy(rgb(dark ? '#a9b4bf' : '#55606b'));
      if (this.renderer) { const c = rgb(dark ? '#12161a' : '#eef1f4'); this.clear = c; this.renderer.setClearColor(new THREE.Color().setRGB(c.x, c.y, c.z, THREE.SRGBColorSpace), 1); }
      this.invalidate();
    };
    this.listen(media, 'change', apply);
    apply();
  }

  follow() {
    const resize = new ResizeObserver(() => {
      const narrow = this.root.clientWidth < 760;
      this.root.classList.toggle('ks-narrow', narrow);
      this.resize();
      for (const chart of this.charts) chart.draw();
    });
    resize.observe(this.root); resize.observe(this.view);
    this.undo.push(() => resize.disconnect());
    this.listen(document, 'visibilitychange', () => this.invalidate());
  }

  resize() {
    if (!this.renderer) return;
    const width = Math.max(this.view.clientWidth, 10), height = Math.max(this.view.clientHeight, 10);
    if (width === this.width && height === this.height) return;
    this.width = width; this.height = height;
    this.setRatio(this.ratio(false));
    this.renderer.setSize(width, height, false);
    const half = 0.5 * this.framed / Math.min(1, width / height);
    this.camera.left = -half * width / height; this.camera.right = half * width / height; this.camera.top = half; this.camera.bottom = -half;
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  ratio(fine) {
    const own = Math.min(window.devicePixelRatio || 1, 2);
    return this.isSlow ? (fine ? 2 : 1) : own;
  }

  setRatio(ratio) {
    if (this.renderer.getPixelRatio() === ratio) return;
    this.renderer.setPixelRatio(ratio);
  }

  refine() {
    if (this.gone || this.state.playing || !this.renderer) return;
    this.setRatio(this.ratio(true));
    this.renderer.render(this.world, this.camera);
  }

  look(centre, height, direction) {
    if (!this.renderer) return;
    this.framed = height;
    this.camera.zoom = 1;
    this.camera.position.copy(centre).addScaledVector(direction.normalize(), 2 * this.size);
    this.controls.target.copy(centre);
    this.width = 0;
    this.resize();
    this.controls.update();
    if (this.state.motion === 'impact') this.measure();
    this.invalidate();
  }

  whole() {
    this.look(this.extent.getCenter(new THREE.Vector3()), 1.07 * this.size, new THREE.Vector3(0.55, -1, 0.42));
  }

  toContact(index = 0) {
    const contact = this.payload.contacts[index], ring = array(contact.ring);
    const box = new THREE.Box3();
    for (let i = 0; i < ring.length; i += 3) box.expandByPoint(new THREE.Vector3(ring[i], ring[i + 1], ring[i + 2]));
    if (box.isEmpty()) return;
    const across = Math.max(box.getSize(new THREE.Vector3()).length(), 0.02 * this.size);
    this.setCut(true);
    this.look(box.getCenter(new THREE.Vector3()), 1.5 * across, new THREE.Vector3(0.25, -1, 0.35));
  }

  key(event) {
    const step = event.shiftKey ? 15 : 5;
    const turns = {ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step]};
    if (turns[event.key]) {
      const offset = this.camera.position.clone().sub(this.controls.target);
      const s = new THREE.Spherical();
      const flat = new THREE.Vector3(offset.x, offset.z, -offset.y);
      s.setFromVector3(flat);
      s.theta += turns[event.key][0] * TURN;
      s.phi = Math.min(Math.max(s.phi + turns[event.key][1] * TURN, 0.01), Math.PI - 0.01);
      flat.setFromSpherical(s);
      this.camera.position.copy(this.controls.target).add(new THREE.Vector3(flat.x, -flat.z, flat.y));
      this.controls.update();
    } else if (event.key === '+' || event.key === '=' || event.key === '-') {
      this.camera.zoom = Math.min(Math.max(this.camera.zoom * (event.key === '-' ? 1 / 1.15 : 1.15), 0.3), 3000);
      this.camera.updateProjectionMatrix();
    } else if (event.key === '0') this.whole();
    else return;
    event.preventDefault();
    this.invalidate();
  }

  // ---- names

  hitAt(event) {
    const box = this.canvas.getBoundingClientRect();
    const place = new THREE.Vector2((event.clientX - box.left) / box.width * 2 - 1, 1 - (event.clientY - box.top) / box.height * 2);
    this.ray.setFromCamera(place, this.camera);
    const hits = this.ray.intersectObjects(this.bodies.filter(b => b.group.visible).map(b => b.surface), false);
    for (const hit of hits) {
      if (this.cut && hit.point.y < 0) continue;
      const body = this.bodies.find(b => b.surface === hit.object);
      const inside = hit.face.normal.dot(this.ray.ray.direction) > 0;
      const face = body.face[hit.face.a];
      return {body, face: inside || face === UNNAMED ? -1 : face};
    }
    return null;
  }

  nameAt(event) {
    const hit = this.renderer && this.hitAt(event);
    if (!hit) return null;
    return hit.face < 0 ? hit.body.name : `${hit.body.name}.${hit.body.faces[hit.face]}`;
  }

  hover(hit, event) {
    for (const body of this.bodies) body.uniforms.hover.value = hit && hit.body === body ? hit.face : -1;
    for (const button of this.faceButtons) button.node.classList.toggle('ks-hot', Boolean(hit && hit.body === button.body && hit.face === button.face));
    this.tip.hidden = !(hit && event);
    if (hit && event) {
      const box = this.canvas.getBoundingClientRect();
      this.tip.textContent = hit.face < 0 ? hit.body.name : `${hit.body.name}.${hit.body.faces[hit.face]}${this.role(hit)}`;
      this.tip.style.left = `${Math.min(event.clientX - box.left, box.width - this.tip.offsetWidth - 20)}px`;
      this.tip.style.top = `${Math.max(event.clientY - box.top, 40)}px`;
    }
    this.invalidate();
  }

  tellHover(hit) {
    const name = hit && hit.face >= 0 ? `${hit.body.name}.${hit.body.faces[hit.face]}` : null;
    if (name === this.hovered) return;
    this.hovered = name;
    this.emit('hover', name);
  }

  hitOf(name) {
    for (const body of this.bodies) {
      const face = name && name.startsWith(body.name + '.') ? body.faces.indexOf(name.slice(body.name.length + 1)) : -1;
      if (face >= 0) return {body, face};
    }
    return null;
  }

  // which faces touch and which are held, in place of what the payload says
  setRoles(roles) {
    for (const body of this.bodies) {
      const of = body.faces.map(face => roles[`${body.name}.${face}`]);
      body.pair = of.flatMap((role, i) => role === 'contact' ? [i] : []);
      const {role, held} = body.surface.geometry.attributes;
      body.face.forEach((face, v) => { role.array[v] = of[face] === 'contact' ? 1 : 0; held.array[v] = of[face] === 'held' ? 1 : 0; });
      role.needsUpdate = held.needsUpdate = true;
    }
    this.invalidate();
  }

  role(hit) {
    return hit.body.pair.includes(hit.face) ? ' (contact)' : '';
  }

  pick(name) {
    if (this.options.copy === false) { this.emit('pick', name); return; }
    const copied = () => this.say(`Copied: ${name}`), failed = () => this.say(name);
    if (navigator.clipboard && window.isSecureContext) navigator.clipboard.writeText(name).then(copied, () => this.copyByHand(name) ? copied() : failed());
    else if (this.copyByHand(name)) copied();
    else failed();
    this.emit('pick', name);
  }

  copyByHand(name) {
    const field = el('textarea', {readonly: '', style: 'position:fixed;opacity:0'});
    field.value = name;
    document.body.append(field);
    field.select();
    let done = false;
    try { done = document.execCommand('copy'); } catch { done = false; }
    field.remove();
    return done;
  }

  say(text) {
    this.said.textContent = text; this.said.hidden = false;
    clearTimeout(this.saying);
    this.saying = setTimeout(() => { this.said.hidden = true; }, 1800);
  }

  // ---- drawing

  invalidate() {
    if (this.asked || this.gone) return;
    this.asked = requestAnimationFrame(now => { this.asked = 0; this.frame(now); });
  }

  frame(now) {
    if (this.gone) return;
    const passed = Math.min((now - (this.last ?? now)) / 1e3, 0.1);
    this.last = now;
    if (this.state.playing && !document.hidden) this.advance(passed);
    if (this.pointer && this.renderer && !this.pointer.buttons) { const e = this.pointer, hit = this.hitAt(e); this.pointer = null; this.hover(hit, e); this.tellHover(hit); }
    if (this.renderer) {
      const pixel = (this.camera.top - this.camera.bottom) / this.camera.zoom / this.height;
      for (const ring of this.rings) { ring.material.uniforms.width.value = 2.2 * pixel; ring.material.uniforms.cut.value = this.cut ? 1 : 0; }
      this.setRatio(this.ratio(false));
      this.renderer.render(this.world, this.camera);
      this.overlay(pixel);
      clearTimeout(this.refining);
      if (this.isSlow && !this.state.playing) this.refining = setTimeout(() => this.refine(), 160);
    }
    this.frames++;
    if (this.state.playing) this.invalidate(); else this.last = undefined;
  }

  overlay(pixel) {
    const raw = 110 * pixel, power = 10 ** Math.floor(Math.log10(raw)), length = [5, 2, 1].map(f => f * power).find(s => s <= raw);
    if (length !== this.barLength || pixel !== this.barPixel) {
      this.barLength = length; this.barPixel = pixel;
      this.bar.firstChild.textContent = millimetres(length);
      this.bar.lastChild.style.width = `${length / pixel}px`;
    }
    const key = this.camera.quaternion.toArray().join();
    if (key !== this.axesKey) {
      this.axesKey = key;
      const inverse = this.camera.quaternion.clone().invert();
      this.axes.replaceChildren();
      const ends = [['x', '#d55e00'], ['y', '#0a7f5f'], ['z', '#2b7bba']].map(([name, colour], i) => ({name, colour, at: new THREE.Vector3().setComponent(i, 1).applyQuaternion(inverse)}));
      ends.sort((a, b) => a.at.z - b.at.z);
      for (const {name, colour, at} of ends) {
        this.axes.append(svgEl('line', {x1: 0, y1: 0, x2: 22 * at.x, y2: -22 * at.y, stroke: colour, 'stroke-width': 2.5, 'stroke-linecap': 'round'}));
        this.axes.append(svgEl('text', {x: 31 * at.x, y: -31 * at.y + 4, 'text-anchor': 'middle'}, name));
      }
    }
    for (const {label, at} of this.dimensions) this.pin(label, at, this.dimensionLines.visible);
    for (const {sign, body} of this.centres) this.pin(sign, new THREE.Vector3(...body.packed.centre), body.group.visible && this.state.motion === 'still' && this.centresShown);
  }

  // an element of the page over a place of the scene
  pin(node, at, shown) {
    const p = at.clone().project(this.camera), x = (p.x + 1) / 2 * this.width, y = (1 - p.y) / 2 * this.height;
    node.toggleAttribute('hidden', !shown || x < 0 || y < 0 || x > this.width || y > this.height);
    node.style.left = `${x}px`; node.style.top = `${y}px`;
  }

  // ---- panel

  check(text, checked, change, chip) {
    const box = el('input', {type: 'checkbox', onchange: () => change(box.checked)});
    box.checked = checked;
    const label = el('label', {}, box, chip ? el('span', {class: 'ks-chip', style: `background:${chip}`}) : null, el('span', {text}));
    label.box = box;
    return label;
  }

  setCut(on) {
    this.cut = on;
    if (this.cutBox) this.cutBox.box.checked = on;
    for (const body of this.bodies) {
      body.uniforms.cut.value = on ? 1 : 0;
      body.surface.material.side = on ? THREE.DoubleSide : THREE.FrontSide;
    }
    this.linesVisible();
    this.invalidate();
  }

  linesVisible() {
    for (const body of this.bodies) {
      body.lines[1].visible = this.mesh;
      body.section.visible = this.mesh && this.cut && this.state.motion === 'still';
    }
  }

  buildPanel() {
    const {payload, panel} = this;
    this.faceButtons = [];
    this.mesh = false; this.cut = false;
    this.modes = [];
    this.bodies.forEach((body, b) => { if (body.motion) for (const k of body.motion.elastic) this.modes.push({body, b, k, frequency: body.motion.frequency[k]}); });
    if (this.bodies.length) {
      panel.append(el('h3', {text: 'View'}));
      const contacts = payload.contacts.map((c, i) => c.ring.shape[0] ? el('button', {type: 'button', text: payload.contacts.length > 1 ? `To ${c.name}` : 'To the contact', onclick: () => this.toContact(i)}) : null);
      panel.append(el('div', {class: 'ks-row'}, el('button', {type: 'button', text: 'Everything', onclick: () => this.whole()}), ...contacts));
      this.cutBox = this.check('Cut open', false, on => this.setCut(on));
      this.meshBox = this.check('Mesh lines', false, on => { this.mesh = on; this.linesVisible(); this.invalidate(); });
      this.dimensionBox = this.check('Dimensions', true, on => { this.dimensionLines.visible = on; this.invalidate(); });
      this.centresShown = true;
      const centreBox = this.centres.length ? this.check('Centres of gravity', true, on => { this.centresShown = on; this.invalidate(); }) : null;
      panel.append(el('div', {class: 'ks-row'}, this.cutBox, this.meshBox, this.dimensionBox, ...[centreBox].filter(Boolean)));
      this.linesVisible();
      panel.append(el('h3', {text: 'Bodies'}));
      this.bodies.forEach((body, i) => {
        panel.append(this.check(body.name, true, on => { body.group.visible = on; this.invalidate(); }, BODY_COLOURS[i % BODY_COLOURS.length][0]),
          el('div', {class: 'ks-soft', text: body.packed.about}), ...this.aboutBody(body));
      });
      const keys = [];
      if (payload.contacts.length) keys.push([CONTACT_COLOUR, 'faces in contact']);
      if (this.rings.length) keys.push([RING_COLOUR, 'first touch']);
      if (payload.bodies.some(b => array(b.held).some(x => x))) keys.push([HELD_COLOUR, 'held']);
      if (keys.length) panel.append(el('div', {class: 'ks-row'}, ...keys.map(([colour, text]) => el('span', {class: 'ks-row'}, el('span', {class: 'ks-chip', style: `background:${colour}`}), el('span', {text})))));
      if (this.centres.length) panel.lastChild.append(el('span', {class: 'ks-row'}, centreSign('#ffffff'), el('span', {text: 'centre of gravity'})));
      if (!payload.facts.length) for (const c of payload.contacts) panel.append(el('div', {class: 'ks-soft', text: `${c.name}: ${c.upper} on ${c.lower}${c.gap === null ? '' : `, gap ${millimetres(c.gap)}`}`}));
    }
    for (const {title, rows} of payload.facts) {
      panel.append(el('h3', {text: title[0].toUpperCase() + title.slice(1)}));
      for (const row of rows) panel.append(this.sentence(row));
    }
    this.buildColour();
    this.buildMotion();
    if (this.bodies.some(b => b.faces.length)) {
      panel.append(el('h3', {text: 'Named faces (a click copies the name)'}));
      for (const body of this.bodies) {
        const list = el('div', {class: 'ks-faces'});
        body.faces.forEach((face, i) => {
          const row = body.packed.rows.find(([what, of]) => what === 'surface' && of === face);
          list.append(el('div', {}, this.faceButton(`${body.name}.${face}`, {body, face: i}), row ? el('span', {class: 'ks-soft', text: row[2]}) : null));
        });
        panel.append(el('div', {class: 'ks-row'}, list));
      }
    }
    if (payload.schematic) {
      const text = new TextEncoder().encode(payload.schematic);
      let binary = '';
      for (const byte of text) binary += String.fromCharCode(byte);
      const picture = el('img', {class: 'ks-schematic', alt: 'Schematic of the network', src: `data:image/svg+xml;base64,${btoa(binary)}`});
      picture.style.minWidth = `${Math.round(LEAST_SCHEMATIC * / width="([\d.]+)"/.exec(payload.schematic)[1])}px`;
      if (this.bodies.length) {
        const net = el('div', {class: 'ks-net', hidden: '', tabindex: 0, 'aria-label': 'Schematic of the network'}, picture);
        this.view.append(net);
        const button = el('button', {type: 'button', text: 'Schematic', 'aria-pressed': 'false', onclick: () => { net.hidden = !net.hidden; button.setAttribute('aria-pressed', String(!net.hidden)); }});
        panel.append(el('h3', {text: 'Network'}), el('div', {class: 'ks-row'}, button));
      } else { this.root.classList.add('ks-flat'); this.chartBox.append(picture); }
    }
    if (payload.notes.length) {
      panel.append(el('h3', {text: 'Notes'}));
      for (const note of payload.notes) panel.append(el('div', {class: 'ks-soft', text: note}));
    }
  }

  // what klack inspect prints about a body; its surfaces stand in the list of names
  aboutBody(body) {
    const several = body.packed.rows.filter(([what]) => what === 'solid').length > 1;  // one may have the name of its body
    const list = rows => {
      const node = el('dl');
      let joint = '';
      for (const [what, name, content] of rows) {
        if (JOINTS.includes(what)) {  // its rows below its name once
          if (joint !== `${what} ${name}`) node.append(el('dt', {class: 'ks-joint', text: joint = `${what} ${name}`}));
          const at = content.indexOf(': ');
          node.append(el('dt', {text: content.slice(0, at)}), el('dd', {text: content.slice(at + 2)}));
          continue;
        }
        const kind = what === 'solid' && /mm(³|\^3)/.test(content) ? 'volume' : what;
        node.append(el('dt', {text: name && (several || name !== body.name) ? `${kind} ${name}` : kind}), el('dd', {text: content || name}));
      }
      return node;
    };
    const rows = body.packed.rows.filter(([what, of]) => what !== 'geometry' && !(what === 'surface' && body.faces.includes(of)));
    const first = rows.filter(([what]) => WEIGHED.includes(what)), others = rows.filter(([what]) => !WEIGHED.includes(what));
    const more = others.length ? el('details', {}, el('summary', {text: `More of ${body.name}`}), list(others)) : null;
    return [first.length ? list(first) : null, more].filter(Boolean);
  }

  // a row, whose names of faces lighten them
  sentence([what, name, content]) {
    const line = el('div', {class: 'ks-said-of'}, el('b', {text: `${name || what}: `}));
    for (const part of content.split(/([^\s:,;]+\.[^\s:,;]+)/)) {
      const hit = this.hitOf(part);
      line.append(hit ? this.faceButton(part, hit) : part);
    }
    return line;
  }

  faceButton(name, hit) {
    const node = el('button', {type: 'button', text: name, onclick: () => this.pick(name), onmouseenter: () => this.hover(hit), onmouseleave: () => this.hover(null),
      onfocus: () => this.hover(hit), onblur: () => this.hover(null)});
    this.faceButtons.push({node, ...hit});
    return node;
  }

  buildColour() {
    const has = this.bodies.some(b => b.motion), stress = Math.max(0, ...this.bodies.map(b => b.stress));
    if (!has) return;
    this.colourBox = el('select', {'aria-label': 'Colour', onchange: () => this.paint()});
    const choices = [['body', 'bodies and faces'], ['move', 'displacement']];
    if (stress > 0) choices.push(['stress', 'stress at peak force']);
    for (const [value, text] of choices) this.colourBox.append(el('option', {value, text}));
    this.panel.append(el('h3', {text: 'Colour'}), this.colourBox);
    this.stressMost = stress;
    for (const body of this.bodies) if (body.motion && stress > 0) {
      const own = body.value;
      for (let i = 0; i < own.length; i++) own[i] = Math.max(1 + Math.log10(Math.max(own[i], 1e-9) / stress) / STRESS_DECADES, 0);
      body.valueAttribute.needsUpdate = true;
    }
    const c = this.legend.querySelector('canvas').getContext('2d');
    for (let i = 0; i < 180; i++) {
      const t = i / 179, colour = [0, 1, 2].map(k => VIRIDIS.reduceRight((sum, row) => sum * t + row[k], 0));
      c.fillStyle = `rgb(${colour.map(x => Math.round(255 * Math.min(Math.max(x, 0), 1))).join(',')})`;
      c.fillRect(i, 0, 1, 1);
    }
  }

  paint() {
    if (!this.colourBox) return;
    const kind = this.colourBox.value, moving = this.state.motion !== 'still';
    const on = kind === 'stress' ? 2 : kind === 'move' && moving ? 1 : 0;
    const alone = on === 1 && this.state.motion === 'mode' ? this.modes[this.state.mode].body : null;
    for (const body of this.bodies) body.uniforms.paint.value = body.motion && (!alone || alone === body) ? on : 0;
    this.legend.hidden = on === 0;
    const [title, , ends] = this.legend.children;
    if (on === 2) { title.textContent = 'von Mises stress at peak force (log)'; ends.lastChild.textContent = `${number(this.stressMost)} MPa`; ends.firstChild.textContent = `${number(this.stressMost / 10 ** STRESS_DECADES)} MPa`; }
    if (on === 1) {
      const mode = this.state.motion === 'mode';
      title.textContent = mode ? 'displacement of the mode' : 'displacement';
      ends.firstChild.textContent = '0'; ends.lastChild.textContent = mode ? 'largest' : `${number(this.spreadMost * 1e3)} µm`;
    }
    this.invalidate();
  }

  buildMotion() {
    const impact = this.times.length > 1 && this.bodies.some(b => b.motion?.frames > 1 || b.travel.length > 1);
    if (!this.modes.length && !impact) return;
    const {panel} = this;
    panel.append(el('h3', {text: 'Motion'}));
    this.motionButtons = {};
    const row = el('div', {class: 'ks-row'});
    for (const [kind, text, there] of [['still', 'Still', true], ['mode', 'Mode', this.modes.length], ['impact', this.bodies.some(b => b.travel.length > 1) ? 'Stroke' : 'Impact', impact]]) if (there) {
      const button = el('button', {type: 'button', text, 'aria-pressed': kind === 'still', onclick: () => this.setMotion(kind)});
      this.motionButtons[kind] = button; row.append(button);
    }
    this.playButton = el('button', {type: 'button', text: 'Pause', hidden: '', onclick: () => this.play(!this.state.playing)});
    row.append(this.playButton);
    panel.append(row);
    if (this.modes.length) {
      this.modeBox = el('select', {'aria-label': 'Mode', onchange: () => this.showMode(Number(this.modeBox.value))});
      this.modes.forEach((mode, i) => this.modeBox.append(el('option', {value: i, text: `${mode.body.name}: ${hertz(mode.frequency)}`})));
      panel.append(this.modeBox);
    }
    this.timeBox = el('input', {type: 'range', min: 0, max: 1000, value: 0, 'aria-label': 'Time', oninput: () => { this.play(false); this.setTime(this.times[0] + (this.times.at(-1) - this.times[0]) * this.timeBox.value / 1000); }});
    this.timeText = el('div', {class: 'ks-soft'});
    this.sizeBox = el('input', {type: 'range', min: 0, max: 100, value: 50, 'aria-label': 'Magnification', oninput: () => this.setSize(Number(this.sizeBox.value))});
    this.sizeText = el('div', {class: 'ks-soft'});
    this.rigidBox = this.check('with the motion as a whole', true, on => { this.state.rigid = on; this.measure(); this.place(); });
    this.motionBox = el('div', {hidden: ''}, this.timeBox, this.timeText, this.sizeBox, this.sizeText, this.rigidBox);
    panel.append(this.motionBox);
  }

  setMotion(kind) {
    if (kind === 'mode') return this.showMode(this.state.mode ?? 0);
    this.state.motion = kind;
    this.motionShown();
    if (kind === 'impact') { this.measure(); this.setTime(this.times[0]); this.play(!this.calm()); } else { this.play(false); this.place(); }
    this.paint();
  }

  calm() {
    return this.options.autoplay === false || window.matchMedia('(prefers-reduced-motion: reduce)').matches;
  }

  motionShown() {
    const {motion} = this.state;
    for (const [kind, button] of Object.entries(this.motionButtons || {})) button.setAttribute('aria-pressed', kind === motion);
    if (!this.motionBox) return;
    this.motionBox.hidden = motion === 'still';
    this.playButton.hidden = motion === 'still';
    if (this.modeBox) this.modeBox.hidden = motion !== 'mode';
    for (const part of [this.timeBox, this.timeText, this.rigidBox]) part.hidden = motion !== 'impact';
    if (!this.bodies.some(b => b.motion?.frames > 1)) this.rigidBox.hidden = true;
    this.linesVisible();
    for (const ring of this.rings) ring.visible = motion === 'still';
    for (const chart of this.charts || []) if (chart.isHistory) chart.moveCursor(motion === 'impact' ? this.state.time : null);
  }

  // magnification of the impact that makes its largest deformation 6 % of the size
  measure() {
    let most = 0, travel = 0;
    const scratch = [];
    for (const body of this.bodies) {
      if (body.motion?.frames > 1) {
        const target = new Float32Array(body.shape.length);
        for (let f = 0; f < body.motion.frames; f += Math.max(1, Math.floor(body.motion.frames / 24))) {
          body.motion.at(f, this.state.rigid, target);
          most = Math.max(most, largest(target));
        }
      }
      for (const z of body.travel) travel = Math.max(travel, Math.abs(z));
      scratch.push(most);
    }
    this.spreadMost = Math.max(most, travel) || 1;
    // a stroke is shown in its true size: its gaps are those of the drawing
    this.unit = most > 0 ? 0.06 * (this.framed || this.size) / this.spreadMost : 1;
    this.setSize(50);
    if (this.sizeBox) this.sizeBox.value = 50;
  }

  setSize(position) {
    if (this.state.motion === 'mode') {
      this.state.share = 0.25 * (position / 100) ** 1.5;
      this.sizeText.textContent = `Largest displacement ${number(100 * this.state.share, 2)} % of the overall size; a mode has no amplitude of its own.`;
    } else {
      this.state.factor = Math.max((this.unit || 1) * 10 ** ((position - 50) / 35), 0);
      this.sizeText.textContent = Math.abs(this.state.factor - 1) < 0.01 ? 'Displacements at true scale' : `Displacements ${number(this.state.factor, 2)} times as large`;
    }
    this.place();
  }

  showMode(index, magnification) {
    const mode = this.modes[index];
    if (!mode) return;
    this.state.motion = 'mode'; this.state.mode = index;
    for (const body of this.bodies) { body.shape.fill(0); body.shapeAttribute.needsUpdate = true; body.uniforms.rigid.value = 0; body.uniforms.spread.value = 1; }
    mode.body.motion.mode(mode.k, mode.body.shape);
    this.modeBox.value = index;
    this.motionShown();
    this.phase = 0;
    const position = magnification === undefined ? 100 * (this.state.share / 0.25) ** (1 / 1.5) : 100 * Math.min(magnification / 0.25, 1) ** (1 / 1.5);
    this.sizeBox.value = position;
    this.setSize(position);
    this.markModes();
    if (this.colourBox && this.colourBox.value === 'body' && !this.colourTouched) { this.colourBox.value = 'move'; this.colourTouched = true; }
    this.paint();
    this.play(!this.calm());
    this.emit('mode', index);
  }

  play(on) {
    this.state.playing = on;
    if (this.playButton) this.playButton.textContent = on ? 'Pause' : 'Play';
    this.last = undefined;
    if (!on && this.state.motion === 'mode') { this.phase = 0.25; this.place(); }
    this.invalidate();
  }

  advance(passed) {
    if (this.state.motion === 'mode') { this.phase = (this.phase + passed / 1.4) % 1; this.place(); }
    else if (this.state.motion === 'impact') {
      const first = this.times[0], last = this.times.at(-1), length = (last - first) * passed / 6;
      let t = this.state.time + length;
      if (t > last) t = first;
      this.setTime(t);
    }
  }

  // t in microseconds, as the axis of the histories
  setTime(t) {
    if (this.times.length < 2) return;
    if (this.state.motion !== 'impact') { this.state.motion = 'impact'; this.measure(); this.motionShown(); this.paint(); }
    const first = this.times[0], last = this.times.at(-1);
    this.state.time = Math.min(Math.max(t, first), last);
    this.timeBox.value = 1000 * (this.state.time - first) / (last - first);
    this.timeText.textContent = `${number(this.state.time, 4)} µs`;
    for (const chart of this.charts) if (chart.isHistory) chart.moveCursor(this.state.time);
    this.place();
    this.emit('time', this.state.time);
  }

  frameAt(time) {
    let low = 0, high = this.times.length - 1;
    while (high - low > 1) { const middle = (low + high) >> 1; if (this.times[middle] <= time) low = middle; else high = middle; }
    return low + (time - this.times[low]) / (this.times[high] - this.times[low] || 1);
  }

  place() {
    const {motion, mode, share, factor, time} = this.state;
    for (const body of this.bodies) {
      const u = body.uniforms;
      if (motion === 'mode') u.amount.value = this.modes[mode].body === body ? share * this.size * Math.sin(2 * Math.PI * (this.phase ?? 0.25)) : 0;
      else if (motion === 'impact') {
        const frame = this.frameAt(time);
        u.spread.value = 1 / this.spreadMost;
        u.amount.value = factor;
        if (body.motion?.frames > 1) { body.motion.at(frame, this.state.rigid, body.shape); body.shapeAttribute.needsUpdate = true; }
        if (body.travel.length > 1) {
          const low = Math.min(Math.floor(frame), body.travel.length - 2), part = frame - low;
          u.rigid.value = factor * ((1 - part) * body.travel[low] + part * body.travel[low + 1]);
        }
      } else { u.amount.value = 0; u.rigid.value = 0; }
    }
    this.invalidate();
  }

  probe(index, vertex) {
    const body = this.bodies[index], {amount, rigid} = body.uniforms;
    return [0, 1, 2].map(i => body.points[3 * vertex + i] + amount.value * body.shape[3 * vertex + i] + (i === 2 ? rigid.value : 0));
  }

  // ---- charts

  buildCharts() {
    this.charts = [];
    const {payload} = this, decoded = curve => ({...curve, x: array(curve.x), y: array(curve.y)});
    for (const curve of payload.histories.map(decoded)) {
      const chart = new Chart(curve.name, [curve], {xUnit: curve.xUnit, yUnit: curve.yUnit, label: `${curve.name} over time; arrow keys move the cursor`});
      chart.isHistory = true;
      const seek = e => { const box = chart.svg.getBoundingClientRect(); this.play(false); this.setTime(chart.back((e.clientX - box.left) * chart.svg.viewBox.baseVal.width / box.width)); };
      this.listen(chart.svg, 'pointerdown', e => { chart.svg.setPointerCapture(e.pointerId); seek(e); });
      this.listen(chart.svg, 'pointermove', e => { if (e.buttons) seek(e); });
      this.listen(chart.svg, 'keydown', e => {
        const step = {ArrowLeft: -1, ArrowRight: 1}[e.key];
        if (!step || this.times.length < 2) return;
        e.preventDefault(); this.play(false);
        this.setTime(this.state.time + step * (this.times.at(-1) - this.times[0]) / 100);
      });
      this.charts.push(chart);
    }
    const bodies = [...new Set(payload.transfer.map(c => c.body))];
    for (const name of bodies) {
      const curves = payload.transfer.filter(c => c.body === name).map(decoded);
      const chart = new Chart(`${name} receptance`, curves, {logarithmic: true, xUnit: curves[0].xUnit, yUnit: curves[0].yUnit,
        label: `Transfer function of ${name}; arrow keys step through its modes`});
      chart.body = name;
      const own = this.modes.map((mode, i) => ({mode, i})).filter(({mode}) => mode.body.name === name);
      const value = f => { const {x, y} = curves[0]; let k = 0; while (k < x.length - 2 && x[k + 1] < f) k++; return y[f - x[k] < x[k + 1] - f ? k : k + 1]; };
      chart.marks = own.filter(({mode}) => mode.frequency / 1e3 >= curves[0].x[0] && mode.frequency / 1e3 <= curves[0].x.at(-1))
        .map(({mode, i}) => ({x: mode.frequency / 1e3, y: value(mode.frequency / 1e3), index: i, text: hertz(mode.frequency)}));
      this.listen(chart.svg, 'pointerdown', e => {
        if (!chart.marks.length) return;
        const box = chart.svg.getBoundingClientRect(), px = (e.clientX - box.left) * chart.svg.viewBox.baseVal.width / box.width;
        const near = chart.marks.reduce((a, b) => Math.abs(chart.x(b.x) - px) < Math.abs(chart.x(a.x) - px) ? b : a);
        this.showMode(near.index);
      });
      this.listen(chart.svg, 'keydown', e => {
        const step = {ArrowLeft: -1, ArrowRight: 1}[e.key];
        if (!step || !chart.marks.length) return;
        e.preventDefault();
        const at = chart.marks.findIndex(m => m.index === this.state.mode);
        this.showMode(chart.marks[Math.min(Math.max(at + step, 0), chart.marks.length - 1)].index);
      });
      this.charts.push(chart);
    }
    for (const chart of this.charts) this.chartBox.append(chart.node);
    if (!this.charts.length && !this.chartBox.childNodes.length) this.chartBox.hidden = true;
    for (const chart of this.charts) chart.draw();
    this.motionShown();
  }

  markModes() {
    for (const chart of this.charts) if (chart.body) {
      for (const mark of chart.marks) mark.chosen = mark.index === this.state.mode;
      chart.draw();
    }
  }

  dispose() {
    if (this.gone) return;
    this.gone = true;
    cancelAnimationFrame(this.asked);
    clearTimeout(this.saying);
    clearTimeout(this.refining);
    for (const call of this.undo) call();
    this.undo = [];
    this.controls?.dispose();
    for (const body of this.bodies) body.dispose();
    for (const ring of this.rings) { ring.geometry.dispose(); ring.material.dispose(); }
    this.dimensionLines.geometry.dispose(); this.dimensionLines.material.dispose();
    if (this.renderer) { this.renderer.dispose(); this.renderer.forceContextLoss(); this.renderer = null; }
    this.root.remove();
    this.listeners = {};
  }
}
