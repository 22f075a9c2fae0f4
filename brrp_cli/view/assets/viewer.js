"use strict";
// The page of `brrp view`: draws the GLB of the page and tells what the record says. The page's
// coordinates are metres, y up, origin in the middle of the objects.
(() => {
  const told = JSON.parse(document.getElementById("told").textContent);
  const find = (id) => document.getElementById(id);
  const NONE = "none of them";
  const objects = new Map(); // id -> {mesh, points, parts, hands, on, card, told}
  let surroundings = null;
  let draw = () => {};

  for (const each of told.objects) objects.set(each.id, { told: each, on: true, parts: [], hands: null });

  // ---- numbers for people -------------------------------------------------------------------
  const two = (value) => (value === null || value === undefined ? "–" : value.toFixed(2));
  const shown = (spread) => `${Number((spread * told.scale.factor).toPrecision(2))} ${told.scale.unit}`;

  function element(tag, parent, text, classes) {
    const made = document.createElement(tag);
    if (text !== undefined) made.textContent = text;
    if (classes) made.className = classes;
    if (parent) parent.append(made);
    return made;
  }

  // ---- the list -----------------------------------------------------------------------------
  function seconds(stages) {
    return Object.values(stages).reduce((sum, each) => sum + each, 0);
  }

  function card(id, entry) {
    const about = entry.told;
    const box = element("div", find("objects"), undefined, "card");
    box.dataset.object = id;
    const head = element("label", box, undefined, "head");
    const tick = element("input", head);
    tick.type = "checkbox";
    tick.checked = true;
    tick.dataset.object = id;
    tick.addEventListener("change", () => switchObject(id, tick.checked));
    element("span", head, undefined, "swatch").style.background = `rgb(${about.colour})`;
    element("span", head, `object ${id}`);
    element("span", head, about.status === "ok" ? "" : about.status.replaceAll("_", " "));
    if (about.message) element("p", box, about.message, "facts");
    if (about.extents) {
      const size = about.extents.map((each) => (each * 100).toFixed(1)).join(" × ");
      element("p", box, `${size} cm, ${about.volume_litre.toFixed(2)} l`, "facts").title =
        `extents along the axes of the ${told.frame} frame`;
    }
    const line = [`${about.points} points`];
    if (about.mean_uncertainty !== undefined) {
      const metres = told.scale.unit === "mm";
      line.push(metres ? `± ${shown(about.mean_uncertainty)} on average`
        : `variance of the logit ${about.mean_uncertainty.toPrecision(2)}`);
    }
    const time = element("p", box, [...line, `${seconds(about.seconds).toFixed(1)} s`].join(", "), "facts");
    time.title = Object.entries(about.seconds).map(([stage, s]) => `${stage} ${s.toFixed(2)} s`).join("\n");
    if (about.retrieved.length) retrieved(box, about);
    entry.card = box;
    entry.tick = tick;
  }

  function retrieved(box, about) {
    const table = element("table", box);
    const head = element("tr", table);
    const titles = {
      "retrieved": "",
      "P": "P(c|R): how probable retrieval holds it, before anything was placed",
      "score": "alignment score: what the frame says for its best placement, 1 at best",
      "weight": "of it in the posterior",
      "size": "factor of its stored size, at its best placement",
    };
    for (const [name, title] of Object.entries(titles)) element("th", head, name).title = title;
    const rows = about.retrieved.map((r) => [r.name, r.probability, r.alignment_score, r.weight, r.size_factor]);
    rows.push([NONE, about.not_in_prior, null, about.weight_not_in_prior, null]);
    const weights = rows.map((row) => (row[3] === null ? row[1] : row[3]));
    const most = weights.indexOf(Math.max(...weights));
    rows.forEach(([name, ...numbers], i) => {
      const row = element("tr", table, undefined, i === most ? "most" : "");
      element("td", row, name).title = name === NONE ? "P: that the prior does not hold it" : name;
      for (const number of numbers) element("td", row, two(number));
    });
  }

  function switchObject(id, on) {
    const entry = objects.get(id);
    entry.on = on;
    entry.tick.checked = on;
    entry.card.classList.toggle("off", !on);
    refresh();
  }

  function pick(id) {
    for (const [each, entry] of objects) entry.card.classList.toggle("picked", each === id);
    if (objects.has(id)) objects.get(id).card.scrollIntoView({ block: "nearest" });
  }

  const about = [told.preset && told.method === "brrp" ? `${told.method}, ${told.preset} preset` : told.method];
  about.push(told.retriever ? `retrieved by ${told.retriever}` : "no prior", `seed ${told.seed}`, `brrp ${told.brrp}`);
  find("about").textContent = about.join("; ");
  for (const [id, entry] of objects) card(id, entry);
  for (const [button, on] of [["all", true], ["none", false]]) {
    find(button).addEventListener("click", () => objects.forEach((_, id) => switchObject(id, on)));
  }
  find("masks").addEventListener("change", (event) => {
    find("masked").hidden = !event.target.checked;
    find("plain").hidden = event.target.checked;
  });

  // ---- the colour scale ---------------------------------------------------------------------
  const top = () => told.scale.top * (find("top").value / 100);

  function drawScale() {
    const context = find("ramp").getContext("2d");
    const row = context.createImageData(256, 1);
    for (let i = 0; i < 256; i++) {
      row.data.set([...told.scale.colours.slice(3 * i, 3 * i + 3), 255], 4 * i);
    }
    context.putImageData(row, 0, 0);
    find("scale-title").textContent = `uncertainty: spread of ${told.scale.meaning}`;
    const ticks = [0, 0.25, 0.5, 0.75, 1].map((share) => element("span", null,
      share === 0 ? "0" : shown(top() * share) + (share === 1 ? " +" : "")));
    find("ticks").replaceChildren(...ticks);
  }

  // ---- the picture --------------------------------------------------------------------------
  function fail(why) {
    find("canvas").hidden = true;
    find("scale").hidden = true;
    find("failure").hidden = false;
    find("failure").textContent = why;
    document.body.dataset.ready = "failed";
  }

  function refresh() {
    const colour = document.querySelector("input[name=colour]:checked").value;
    for (const entry of objects.values()) {
      if (entry.mesh) {
        entry.mesh.visible = entry.on && find("show-meshes").checked;
        paint(entry, colour);
      }
      if (entry.points) entry.points.visible = entry.on && find("show-points").checked;
      if (entry.hands) entry.hands.visible = entry.on && find("show-grasps").checked;
      for (const part of entry.parts) part.visible = entry.on && find("show-plan").checked;
    }
    if (surroundings) surroundings.visible = find("show-table").checked;
    find("scale").hidden = colour !== "uncertainty" || !find("show-meshes").checked;
    drawScale();
    draw();
  }

  function paint(entry, colour) {
    const target = entry.mesh.geometry.attributes.color;
    if (colour === "seen") target.array.set(entry.seen);
    else if (colour === "object") fill(target.array, () => entry.told.colour);
    else {
      const scale = told.scale.colours;
      fill(target.array, (i) => {
        const at = 3 * Math.min(255, Math.floor((256 * entry.spread[i]) / top()));
        return [scale[at], scale[at + 1], scale[at + 2]];
      });
    }
    target.needsUpdate = true;
  }

  function fill(array, colourOf) {
    for (let i = 0; i < array.length / 3; i++) {
      const colour = colourOf(i);
      for (let c = 0; c < 3; c++) array[3 * i + c] = colour[c] / 255;
    }
  }

  function bytes(base64) {
    const text = atob(base64);
    const array = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) array[i] = text.charCodeAt(i);
    return array.buffer;
  }

  function rgb(attribute) {
    const array = new Float32Array(3 * attribute.count);
    for (let i = 0; i < attribute.count; i++) {
      array.set([attribute.getX(i), attribute.getY(i), attribute.getZ(i)], 3 * i);
    }
    return array;
  }

  function take(node) {
    const [, plan, kind, number] = /^(plan_)?(object|points|grasps)_(-?\d+)/.exec(node.name) || [];
    if (!kind) return;
    const geometry = node.geometry;
    const entry = objects.get(Number(number));
    const colours = rgb(geometry.attributes.color);
    geometry.setAttribute("color", new THREE.BufferAttribute(colours.slice(), 3));
    if (kind === "points") {
      node.material = new THREE.PointsMaterial({ vertexColors: true });
      if (entry) entry.points = node;
      else surroundings = node;
      return;
    }
    if (!entry) return;
    if (kind === "grasps") {
      geometry.computeVertexNormals();
      node.material = new THREE.MeshLambertMaterial({ vertexColors: true, flatShading: true });
      find("grasps-label").hidden = false;
      entry.hands = node;
      return;
    }
    geometry.computeVertexNormals();
    node.material = new THREE.MeshLambertMaterial({
      vertexColors: true, side: THREE.DoubleSide,
      ...(plan ? { transparent: true, opacity: 0.55, flatShading: true, depthWrite: false } : {}),
    });
    if (plan) {
      find("plan-label").hidden = false;
      entry.parts.push(node);
      return;
    }
    entry.mesh = node;
    entry.seen = colours;
    entry.spread = geometry.attributes._spread.array;
  }

  function start(gltf) {
    const canvas = find("canvas");
    const renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    renderer.setClearColor(0xf3f4f6);
    const scene = new THREE.Scene();
    const world = new THREE.Group();
    world.matrixAutoUpdate = false;
    world.matrix.set(...told.camera.T_page_frame);
    scene.add(world);
    if (gltf) {
      const nodes = [];
      gltf.scene.traverse((node) => { if (node.isMesh || node.isPoints) nodes.push(node); });
      nodes.forEach(take);
      world.add(gltf.scene);
    }
    const camera = new THREE.PerspectiveCamera(40, 1, 0.01, 50);
    const light = new THREE.DirectionalLight(0xffffff, 2.2);
    light.position.set(0.3, 0.5, 1);
    camera.add(light);
    scene.add(camera, new THREE.AmbientLight(0xffffff, 1.3));

    const controls = new THREE.OrbitControls(camera, canvas);
    draw = () => renderer.render(scene, camera);
    controls.addEventListener("change", draw);

    const seenFrom = new THREE.Vector3(...told.camera.position);
    const views = {
      camera: seenFrom,
      behind: new THREE.Vector3(-seenFrom.x, seenFrom.y, -seenFrom.z),
      above: new THREE.Vector3(0, seenFrom.length(), 1e-3),
    };
    const look = (name) => {
      camera.position.copy(views[name]);
      controls.target.set(0, 0, 0);
      controls.update();
      draw();
    };
    document.querySelectorAll("[data-view]").forEach((button) => {
      button.addEventListener("click", () => look(button.dataset.view));
    });

    const resize = () => {
      const { clientWidth, clientHeight } = canvas.parentElement;
      renderer.setSize(clientWidth, clientHeight, false);
      camera.aspect = clientWidth / clientHeight;
      // All objects fill the shorter side of the window.
      const half = Math.asin(Math.min(0.9, told.camera.radius / seenFrom.length()));
      camera.fov = (Math.atan(Math.tan(half) / Math.min(1, camera.aspect)) * 360) / Math.PI;
      camera.updateProjectionMatrix();
      // three.js sizes points as if the lens were 90 degrees wide.
      const size = (1.3 * told.camera.point_size) / Math.tan((camera.fov * Math.PI) / 360);
      world.traverse((node) => { if (node.isPoints) node.material.size = size; });
      draw();
    };
    window.addEventListener("resize", resize);

    const raycaster = new THREE.Raycaster();
    let pressed = null;
    canvas.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointerup", (event) => {
      if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
      const box = canvas.getBoundingClientRect();
      raycaster.setFromCamera(new THREE.Vector2(
        ((event.clientX - box.left) / box.width) * 2 - 1,
        1 - ((event.clientY - box.top) / box.height) * 2,
      ), camera);
      const meshes = [...objects].filter(([, e]) => e.mesh && e.mesh.visible);
      const hit = raycaster.intersectObjects(meshes.map(([, e]) => e.mesh))[0];
      if (!hit) return;
      const [id, entry] = meshes.find(([, e]) => e.mesh === hit.object);
      const place = hit.object.worldToLocal(hit.point.clone()).toArray().map((each) => each.toFixed(3));
      find("probe").textContent =
        `object ${id}: spread ${shown(entry.spread[hit.face.a])}; (${place.join(", ")}) m, ${told.frame} frame`;
      pick(id);
    });

    for (const id of ["show-meshes", "show-points", "show-table", "show-plan", "show-grasps", "top"]) {
      find(id).addEventListener("input", refresh);
    }
    document.querySelectorAll("input[name=colour]").forEach((each) => each.addEventListener("change", refresh));
    resize();
    look("camera");
    refresh();
    document.body.dataset.ready = "yes";
  }

  drawScale();
  THREE.ColorManagement.enabled = false;
  try {
    const packed = find("glb").textContent.trim();
    if (!packed) start(null);
    else new THREE.GLTFLoader().parse(bytes(packed), "", (gltf) => {
      try { start(gltf); } catch (error) { fail(`This browser cannot draw in 3D (WebGL): ${error.message}`); }
    }, (error) => fail(`The scene in this page is damaged: ${error.message}`));
  } catch (error) {
    fail(`This browser cannot draw in 3D (WebGL): ${error.message}`);
  }
})();
