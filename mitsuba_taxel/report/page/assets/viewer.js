"use strict";
// A view of the deformed pad, drawn pixel by pixel with a depth buffer: it needs neither WebGL nor a network.
// Lengths are in mm. The silicone is a closed surface, so what shows the back of its triangles is the cut through it.
(() => {
  const data = JSON.parse(document.getElementById("solids").textContent);
  const root = document.getElementById("viewer");
  if (!data.panels.length || !root) return;
  const find = (name) => root.querySelector(`[data-part="${name}"]`);
  const canvas = find("canvas"), context = canvas.getContext("2d");
  const stepSlider = find("step"), cutSlider = find("cut"), colouring = find("colouring"), rays = find("rays"), magnify = find("magnify");
  const panelChoice = find("panel"), words = find("words"), legend = find("legend");

  const REGION_COLOURS = [[230, 159, 0], [86, 180, 233], [150, 150, 150], [190, 190, 190], [205, 205, 205]];
  const VIRIDIS = [[68, 1, 84], [71, 45, 123], [59, 82, 139], [44, 114, 142], [33, 145, 140], [40, 174, 128],
                   [94, 201, 98], [173, 220, 48], [253, 231, 37]];
  const INDENTER = [140, 100, 50], CUT = [178, 120, 140], REACHED = [213, 94, 0], OTHER = [120, 120, 120];
  const FIXED_COLOURS = { led: [255, 60, 30], phototransistor: [0, 158, 115], board: [168, 172, 180], other: [72, 76, 86] };
  const LIGHT = [-0.35, 0.45, 0.82];

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  const lengths = (packed) => Float32Array.from(new Int16Array(bytes(packed)), (n) => n * panel().unit);
  const indices = (packed) => new Uint16Array(bytes(packed));
  const memory = new Map();
  const unpacked = (packed, how) => {
    if (!memory.has(packed)) memory.set(packed, how(packed));
    return memory.get(packed);
  };

  const PITCH = 0.5;
  const view = { yaw: -0.5, pitch: PITCH, zoom: 1, quick: false };
  const panel = () => data.panels[panelChoice ? panelChoice.value : 0];
  const step = () => panel().steps[stepSlider.value];
  const home = () => panel().steps[panel().rest];

  const moves = () => Boolean(panel().most) && step().topology === home().topology;
  const magnified = () => moves() ? Number(magnify.value) : 1;

  // Where the pad's vertices are drawn.
  function shape() {
    const now = unpacked(step().vertices, lengths), factor = magnified();
    if (factor === 1) return now;
    const before = unpacked(home().vertices, lengths);
    return now.map((place, i) => before[i] + factor * (place - before[i]));
  }

  function displacements() {
    if (!moves()) return null;
    const now = unpacked(step().vertices, lengths), before = unpacked(home().vertices, lengths);
    const size = new Float32Array(now.length / 3);
    for (let i = 0; i < size.length; i++)
      size[i] = Math.hypot(now[3 * i] - before[3 * i], now[3 * i + 1] - before[3 * i + 1], now[3 * i + 2] - before[3 * i + 2]);
    return size;
  }

  function heat(share) {
    const place = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1), low = Math.min(Math.floor(place), VIRIDIS.length - 2);
    return VIRIDIS[low].map((value, i) => value + (place - low) * (VIRIDIS[low + 1][i] - value));
  }

  // What is drawn: the world's x to the right at yaw 0, y away from the eye, z upwards.
  class Picture {
    constructor(width, height, ground) {
      this.width = width;
      this.height = height;
      this.image = context.createImageData(width, height);
      this.pixels = new Uint32Array(this.image.data.buffer).fill(ground);
      this.depth = new Float32Array(width * height).fill(-Infinity);
      this.inside = new Uint8Array(width * height); // whether the silicone's inside is seen
      const [lower, upper] = panel().frame;
      this.centre = lower.map((low, i) => 0.5 * (low + upper[i]));
      const [long, deep, high] = upper.map((end, i) => end - lower[i]), across = Math.hypot(long, deep);
      const tall = across * Math.sin(PITCH) + high * Math.cos(PITCH); // as it stands before it is turned
      this.scale = 0.95 * view.zoom * Math.min(width / across, height / tall);
      const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
      this.axes = [[cy, sy, 0], [-sy * sp, cy * sp, cp], [sy * cp, -cy * cp, sp]]; // right, up, towards the eye
    }

    project(vertices) {
      const count = vertices.length / 3, placed = new Float32Array(4 * count), [right, up, near] = this.axes;
      for (let i = 0; i < count; i++) {
        const [x, y, z] = [0, 1, 2].map((axis) => vertices[3 * i + axis] - this.centre[axis]);
        placed[4 * i] = this.width / 2 + this.scale * (right[0] * x + right[1] * y + right[2] * z);
        placed[4 * i + 1] = this.height / 2 - this.scale * (up[0] * x + up[1] * y + up[2] * z);
        placed[4 * i + 2] = near[0] * x + near[1] * y + near[2] * z;
        placed[4 * i + 3] = vertices[3 * i + 1];
      }
      return placed;
    }

    // Fill triangles; front, back: their colours; what lies before the plane y = cut is left out; what glows has no shade.
    // Of what is veiled every other pixel.
    fill(vertices, triangles, front, back, cut, glows = false, veiled = false) {
      const placed = this.project(vertices);
      for (let t = 0; t < triangles.length; t += 3) {
        const [a, b, c] = [4 * triangles[t], 4 * triangles[t + 1], 4 * triangles[t + 2]];
        const [ax, ay, bx, by, cx, cy] = [placed[a], placed[a + 1], placed[b], placed[b + 1], placed[c], placed[c + 1]];
        const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
        if (!area || Math.max(placed[a + 3], placed[b + 3], placed[c + 3]) < cut) continue;
        const colour = area < 0 ? front(t / 3) : back;
        const shown = colour && (glows || area > 0 ? opaque(colour) : shade(colour, placed, a, b, c, this.scale));
        if (shown === null) continue;
        const top = Math.max(Math.ceil(Math.min(ay, by, cy)), 0), bottom = Math.min(Math.floor(Math.max(ay, by, cy)), this.height - 1);
        const left = Math.max(Math.ceil(Math.min(ax, bx, cx)), 0), end = Math.min(Math.floor(Math.max(ax, bx, cx)), this.width - 1);
        for (let y = top; y <= bottom; y++)
          for (let x = left; x <= end; x++) {
            const u = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area, v = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area;
            if (u < 0 || v < 0 || u + v > 1 || veiled && (x + y) % 2) continue;
            if (placed[a + 3] + u * (placed[b + 3] - placed[a + 3]) + v * (placed[c + 3] - placed[a + 3]) < cut) continue;
            const depth = placed[a + 2] + u * (placed[b + 2] - placed[a + 2]) + v * (placed[c + 2] - placed[a + 2]);
            const pixel = y * this.width + x;
            if (depth > this.depth[pixel]) {
              this.depth[pixel] = depth;
              this.pixels[pixel] = shown;
              this.inside[pixel] = area > 0;
            }
          }
      }
    }

    // Put the inside of what has been filled where the plane y = cut is: there the eye meets it.
    close(cut) {
      const [right, up, near] = this.axes;
      if (near[1] >= 0) return;
      for (let y = 0; y < this.height; y++)
        for (let x = 0; x < this.width; x++)
          if (this.inside[y * this.width + x]) {
            const across = (x - this.width / 2) / this.scale, upwards = (this.height / 2 - y) / this.scale;
            this.depth[y * this.width + x] = (cut - this.centre[1] - right[1] * across - up[1] * upwards) / near[1];
          }
    }

    // Lines from point to point, in front of surfaces that they touch.
    line(vertices, colour) {
      const placed = this.project(vertices), shown = opaque(colour);
      for (let i = 0; i + 4 < placed.length; i += 4) {
        const [x, y, depth, , dx, dy, deeper] = [...placed.subarray(i, i + 4), placed[i + 4] - placed[i], placed[i + 5] - placed[i + 1], placed[i + 6] - placed[i + 2]];
        const count = Math.ceil(Math.max(Math.abs(dx), Math.abs(dy), 1));
        for (let n = 0; n <= count; n++) {
          const px = Math.round(x + dx * n / count), py = Math.round(y + dy * n / count), pixel = py * this.width + px;
          if (px < 0 || py < 0 || px >= this.width || py >= this.height) continue;
          if (depth + deeper * n / count > this.depth[pixel] - 0.03) this.pixels[pixel] = shown;
        }
      }
    }
  }

  // Light paths are those of the pad as it is.
  const showsRays = () => Boolean(rays && rays.checked && step().rays && magnified() === 1);

  const opaque = (colour) => (255 << 24 | colour[2] << 16 | colour[1] << 8 | colour[0]) >>> 0;

  function shade(colour, placed, a, b, c, scale) {
    const [ux, uy, uz] = [(placed[b] - placed[a]) / scale, (placed[a + 1] - placed[b + 1]) / scale, placed[b + 2] - placed[a + 2]];
    const [vx, vy, vz] = [(placed[c] - placed[a]) / scale, (placed[a + 1] - placed[c + 1]) / scale, placed[c + 2] - placed[a + 2]];
    const normal = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], size = Math.hypot(...normal) || 1;
    const cosine = normal.reduce((sum, part, i) => sum + part * LIGHT[i], 0) / size;
    const factor = 0.5 + 0.5 * Math.max(cosine, 0);
    return opaque(colour.map((part) => Math.round(part * factor)));
  }

  function draw() {
    const ratio = view.quick ? 1 : Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (!width || !height) return;
    canvas.width = width;
    canvas.height = height;
    const ground = getComputedStyle(canvas).backgroundColor.match(/\d+/g).map(Number);
    const picture = new Picture(width, height, opaque(ground));
    const [front, depth] = [panel().box[0][1], panel().box[1][1] - panel().box[0][1]];
    const cut = cutSlider.value > 0 ? front + depth * cutSlider.value / 100 : -Infinity; // a pressed pad bulges
    const now = step(), topology = panel().topologies[now.topology];
    const regions = unpacked(topology.regions, (packed) => new Uint8Array(bytes(packed)));
    const triangles = unpacked(topology.triangles, indices);
    const moved = colouring.value === "displacement" ? displacements() : null;
    const pressure = colouring.value === "pressure" ? unpacked(now.pressure, (packed) => new Uint8Array(bytes(packed))) : null;
    const mean = (values, t) => (values[triangles[3 * t]] + values[triangles[3 * t + 1]] + values[triangles[3 * t + 2]]) / 3;
    const colour = moved
      ? (t) => heat(mean(moved, t) / panel().most)
      : (t) => pressure && mean(pressure, t) ? heat(mean(pressure, t) / 255) : REGION_COLOURS[regions[t] - 1];
    picture.fill(shape(), triangles, colour, CUT, cut);
    picture.close(cut);
    for (const solid of panel().fixed)
      if (solid.y >= cut - 0.05)
        picture.fill(unpacked(solid.vertices, lengths), unpacked(solid.triangles, indices), () => FIXED_COLOURS[solid.kind], null, -Infinity, solid.kind === "led" || solid.kind === "phototransistor");
    if (showsRays())
      for (const [kind, tint] of [["others", OTHER], ["reached", REACHED]])
        for (const path of now.rays[kind]) picture.line(unpacked(path, lengths), tint);
    if (magnified() === 1)
      for (const solid of now.indenters || [])
        picture.fill(unpacked(solid.vertices, lengths), unpacked(solid.triangles, indices), () => INDENTER, INDENTER, cut, false, true);
    context.putImageData(picture.image, 0, 0);
    if (magnified() !== 1) {
      context.font = `${Math.round(14 * ratio)}px system-ui, sans-serif`;
      context.fillStyle = getComputedStyle(words).color;
      context.fillText(`deformation shown ${magnified()} times`, 10 * ratio, height - 10 * ratio);
    }
    describe(now, moved ? ["Displacement", panel().most, "mm"] : pressure ? ["Contact pressure", panel().pressure, "MPa"] : null);
  }

  function describe(now, scale) {
    const part = cutSlider.value > 0 ? `cut open ${cutSlider.value} % of its depth from the front` : "whole";
    const light = showsRays()
      ? ` ${now.rays.reached.length} light paths that reach phototransistor ${panel().taxel} are drawn, and ${now.rays.others.length} others.` : "";
    const moved_by = panel().most && now.largest !== null ? `; largest displacement ${now.largest} mm since ${home().words}` : "";
    const text = `${now.words}${moved_by}. The pad is shown ${part}${magnified() === 1 ? "" : `, its deformation ${magnified()} times as large`}.${light}`;
    if (words.textContent !== text) words.textContent = text;
    canvas.setAttribute("aria-label", `Deformed pad: ${text}`);
    stepSlider.setAttribute("aria-valuetext", now.words);
    legend.hidden = !scale;
    if (scale) {
      find("quantity").textContent = scale[0];
      find("most").textContent = `${scale[1]} ${scale[2]}`;
    }
    root.dataset.drawn = `${panel().name}|${stepSlider.value}`;
  }

  function choosePanel() {
    memory.clear(); // the same text stands for other lengths in another panel's unit
    stepSlider.max = panel().steps.length - 1;
    stepSlider.value = stepSlider.max;
    cutSlider.value = panel().cut;
    magnify.disabled = !panel().most;
    for (const [name, most] of [["displacement", panel().most], ["pressure", panel().pressure]]) {
      const choice = colouring.querySelector(`[value=${name}]`);
      choice.hidden = choice.disabled = !most;
      if (choice.disabled && colouring.value === name) colouring.value = "region";
    }
    colouring.disabled = !panel().most && !panel().pressure;
    later();
  }

  let waiting = false, settling = 0;
  function later(quick = false) {
    view.quick = quick;
    clearTimeout(settling);
    if (quick) settling = setTimeout(later, 200);
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; draw(); });
  }

  function turn(across, upwards) {
    view.yaw += across;
    view.pitch = Math.min(Math.max(view.pitch + upwards, -0.3), Math.PI / 2);
    later(true);
  }

  function zoom(factor) {
    view.zoom = Math.min(Math.max(view.zoom * factor, 0.5), 8);
    later(true);
  }

  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons) turn(-event.movementX * 0.01, event.movementY * 0.01);
  });
  canvas.addEventListener("keydown", (event) => {
    const turns = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    if (turns[event.key]) turn(...turns[event.key]);
    else if ("+=".includes(event.key)) zoom(1.2);
    else if (event.key === "-") zoom(1 / 1.2);
    else return;
    event.preventDefault();
  });
  find("closer").addEventListener("click", () => zoom(1.2));
  find("further").addEventListener("click", () => zoom(1 / 1.2));
  for (const slider of [stepSlider, cutSlider]) slider.addEventListener("input", () => later(true));
  for (const choice of [colouring, rays, magnify]) if (choice) choice.addEventListener("change", () => later());
  if (panelChoice) panelChoice.addEventListener("change", choosePanel);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => later());
  new ResizeObserver(() => later()).observe(canvas);
  root.hidden = false;
  choosePanel();
})();
