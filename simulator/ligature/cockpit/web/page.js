// The page's own part beside viser's: the first minute, hands (keys, game pad, touch, drags), the camera's picture.
// It speaks with the simulator over a connection of its own, and knows itself by the pass that its page was given.
"use strict";
(() => {
  // --- what hands can do: right, up, into the picture; turns about these; the jaw -------------------------------------
  const RIGHT = 0, UP = 1, INTO = 2, TILT = 3, YAW = 4, ROLL = 5, JAW = 6, AXES = 7;
  const MOVES = { KeyD: [RIGHT, 1], KeyA: [RIGHT, -1], KeyW: [UP, 1], KeyS: [UP, -1], KeyE: [INTO, 1], KeyQ: [INTO, -1] };
  const TURNS = { KeyD: [YAW, -1], KeyA: [YAW, 1], KeyW: [TILT, 1], KeyS: [TILT, -1], KeyE: [ROLL, 1], KeyQ: [ROLL, -1] };
  const JAWS = { KeyX: [JAW, 1], KeyZ: [JAW, -1] };
  const ONCE = {
    Digit1: () => order("speed", "fine"), Digit2: () => order("speed", "normal"), Digit3: () => order("speed", "fast"),
    KeyN: () => order("next"), Space: () => { rest(); order("hold"); },
  };
  const HELP = [
    ["A D · W S", "move the tip left, right · up, down, as you see it"],
    ["Q · E", "move it towards you · into the picture"],
    ["Shift with these", "turn the tip about the same directions"],
    ["Z · X", "close · open the jaw"],
    ["1 2 3", "fine, normal, fast"],
    ["N", "next arm"],
    ["Space", "hold: every arm stays where it is"],
    ["V", "camera's picture or 3D view as the large one"],
    ["A throw", "the box at the top left picks the needle up, brings it to the tissue and drives it; your hand takes over at any time"],
    ["?", "this help"],
    ["Mouse or finger", "drag a tip in the camera's picture; sliders and the gizmo at the right"],
    ["Game pad", "left stick moves, right stick turns, triggers out and in, shoulders roll, A and B the jaw, X next arm"],
  ];
  const WORDS = [
    ["Behind the clock", "time that the simulation has lost to the wall clock since it began. It does not grow on a machine that is fast enough; the present speed is the figure beside “× real time”."],
    ["Hold", "an arm slows down and stops when your browser answers late, and goes on when it answers again within half a second. What a button has begun waits longer: the arm goes on for two seconds without your browser, then stands until it answers."],
  ];
  const REPEAT = 40; // milliseconds between messages while something is held
  const DEAD_ZONE = 0.15;
  const KEPT = { hints: "ligature_hints", theme: "ligature_theme" };

  // --- small tools ----------------------------------------------------------------------------------------------------
  const make = (tag, attributes = {}, ...children) => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
      else if (value === true) element.setAttribute(name, "");
      else if (value !== false && value !== null) element.setAttribute(name, value);
    }
    element.append(...children);
    return element;
  };
  const kept = (name) => { try { return localStorage.getItem(name); } catch { return null; } };
  const keep = (name, value) => { try { localStorage.setItem(name, value); } catch { /* private windows */ } };

  // --- the connection -------------------------------------------------------------------------------------------------
  let socket = null, pass = "", facts = {};
  const order = (word, value = null) => {
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ do: word, value }));
  };
  const connect = () => {
    const shown = document.getElementById("ligature-pass")?.dataset.pass;
    if (!shown || (shown === pass && socket && socket.readyState <= WebSocket.OPEN)) return;
    socket?.close();
    pass = shown;
    const mine = (socket = new WebSocket(location.origin.replace(/^http/, "ws") + "/wire"));
    mine.binaryType = "arraybuffer";
    mine.onopen = () => {
      order("hello", shown);
      if (kept(KEPT.theme)) order("dark", kept(KEPT.theme) !== "light"); // also what was pressed without a connection
      sendView();
    };
    mine.onmessage = (event) => (typeof event.data === "string" ? inform(JSON.parse(event.data)) : show(event.data));
    mine.onclose = () => { if (mine === socket) inform({ ...facts, operates: false, free: false }); };
  };

  // --- hands ----------------------------------------------------------------------------------------------------------
  const held = new Set(), touched = new Map();
  let turning = false, pad = new Array(AXES).fill(0), buttons = [], sent = "";
  const motion = () => {
    const sum = pad.slice();
    for (const code of held) {
      const [axis, way] = (turning && TURNS[code]) || MOVES[code] || JAWS[code];
      sum[axis] += way;
    }
    for (const [axis, way] of touched.values()) sum[axis] += way;
    return sum.map((share) => Math.max(-1, Math.min(1, share)));
  };
  const moves = (again = false) => {
    const now = motion(), text = now.join(), rests = now.every((share) => share === 0);
    if (!facts.operates || (text === sent && (rests || !again))) return;
    sent = text;
    order("move", now);
    if (!rests) done(now[JAW] ? "jaw" : "move");
  };
  const rest = () => { held.clear(); touched.clear(); moves(); };
  setInterval(() => { readPad(); moves(true); }, REPEAT);

  const writing = (element) =>
    element?.closest?.("input, textarea, select, [contenteditable='true'], dialog") !== null && element?.closest !== undefined;
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || writing(event.target)) return;
    if (event.key === "?") { event.preventDefault(); event.stopImmediatePropagation(); help(); return; }
    if (event.code === "KeyV") { if (!event.repeat) swap(); return; }
    if (!facts.operates) return;
    turning = event.shiftKey;
    const onButton = event.target.closest?.("button, a, [role=tab], [role=button]");
    if (MOVES[event.code] || JAWS[event.code]) held.add(event.code);
    else if (ONCE[event.code] && !(event.code === "Space" && onButton)) { if (!event.repeat) ONCE[event.code](); }
    else { moves(); return; }
    event.preventDefault();
    event.stopImmediatePropagation(); // the 3D view would fly with the same keys
    moves();
  }, true);
  addEventListener("keyup", (event) => {
    turning = event.shiftKey;
    if (held.delete(event.code)) event.stopImmediatePropagation();
    moves();
  }, true);
  addEventListener("blur", rest);
  document.addEventListener("visibilitychange", () => { rest(); sendView(); });

  const readPad = () => {
    const found = [...(navigator.getGamepads?.() ?? [])].find((one) => one?.connected);
    const axis = (i) => { const a = found.axes[i] ?? 0; return Math.abs(a) < DEAD_ZONE ? 0 : a; };
    const button = (i) => found.buttons[i]?.value ?? 0;
    if (!found) { pad.fill(0); return; }
    pad = [axis(0), -axis(1), button(7) - button(6), -axis(3), -axis(2), button(5) - button(4), button(1) - button(0)];
    const pressed = found.buttons.map((one) => one.pressed), fresh = (i) => pressed[i] && !buttons[i];
    if (fresh(2)) order("next");
    if (fresh(3)) swap();
    if (fresh(12)) order("speed", "fast");
    if (fresh(13)) order("speed", "fine");
    buttons = pressed;
  };

  // --- the camera's picture -------------------------------------------------------------------------------------------
  let large = false, stereo = false, url = "", eyes = 1;
  const image = make("img", { id: "lig-image", alt: "What the endoscope sees", draggable: "false" });
  const show = (picture) => { // a byte that counts the eyes, then a JPEG of them side by side
    const old = url, count = new Uint8Array(picture)[0];
    image.src = url = URL.createObjectURL(new Blob([picture.slice(1)], { type: "image/jpeg" }));
    image.onload = () => { eyes = count; shown(); };
    image.onerror = () => shown();
    const shown = () => { if (old) URL.revokeObjectURL(old); order("seen"); };
    place();
  };
  const place = () => {
    const small = document.getElementById("ligature-picture"), home = large ? main : small;
    if (home && image.parentElement !== home) home.append(image);
    if (!home && !large) image.remove();
  };
  const sendView = () => {
    const high = Math.min(Math.round((main.clientHeight || 240) * devicePixelRatio), 480);
    order("view", [large, document.hidden ? 0 : large ? Math.max(high, 120) : 240, stereo]);
  };
  const swap = () => {
    if (!facts.eyes) return;
    large = !large;
    root.classList.toggle("large", large);
    swapper.textContent = large ? "3D view" : "Camera";
    swapper.setAttribute("aria-pressed", String(large));
    // what is not shown is not drawn: viser draws its canvas only where it can be seen
    if (host) host.style.display = large ? "none" : "";
    place();
    sendView();
  };
  let dragged = false, begun = null;
  // where the eye's picture under the pointer stands in the window as a drag begins: another size or another number of
  // eyes in between must not move an arm
  const stands = (event) => {
    // the picture fits its box as a whole, so it may be smaller
    const box = image.getBoundingClientRect();
    const scale = Math.min(box.width / (image.naturalWidth || 1), box.height / (image.naturalHeight || 1));
    const wide = (scale * image.naturalWidth) / eyes, high = scale * image.naturalHeight;
    const left = box.left + box.width / 2 - (eyes * wide) / 2;
    const eye = Math.min(Math.max(Math.floor((event.clientX - left) / wide), 0), eyes - 1);
    return { x: left + (eye + 0.5) * wide, y: box.top + box.height / 2, high };
  };
  const share = (event) => {
    const clip = (value) => Math.max(-4, Math.min(4, value || 0));
    return [clip((event.clientX - begun.x) / begun.high), clip((begun.y - event.clientY) / begun.high)];
  };
  image.addEventListener("pointerdown", (event) => {
    dragged = false;
    begun = { ...stands(event), clientX: event.clientX, clientY: event.clientY };
    image.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  image.addEventListener("pointermove", (event) => {
    if (!begun) return;
    const far = Math.hypot(event.clientX - begun.clientX, event.clientY - begun.clientY) > 4;
    if (!dragged && far && facts.operates && begun.high) { dragged = true; order("drag", ["start", ...share(begun)]); done("move"); }
    if (dragged) order("drag", ["move", ...share(event)]);
  });
  const lets = (event) => {
    if (!begun) return;
    if (dragged) order("drag", ["end", ...share(event)]);
    else if (event.type === "pointerup" && !large) swap();
    begun = null;
  };
  image.addEventListener("pointerup", lets);
  image.addEventListener("pointercancel", lets);

  // --- what is shown --------------------------------------------------------------------------------------------------
  const button = (label, action, attributes = {}) => make("button", { type: "button", onclick: action, ...attributes }, label);
  const main = make("div", { id: "lig-main" });
  const starter = button("Start", () => { order("start"); foldSheet(); }, { id: "lig-start", class: "lig-first" });
  const welcome = make("section", { id: "lig-welcome", "aria-label": "First steps", hidden: true },
    make("p", {}, "Take control, power the instruments, bring them into view: one button."),
    starter, button("Only watch", () => { watching = true; update(); }));
  const swapper = button("Camera", swap, { id: "lig-swap", title: "Large: camera's picture or 3D view (V)", "aria-pressed": "false" });
  const eyesButton = button("Both eyes", () => {
    stereo = !stereo;
    eyesButton.setAttribute("aria-pressed", String(stereo));
    sendView();
  }, { id: "lig-eyes", title: "Pictures of both eyes, side by side", "aria-pressed": "false" });
  const armButton = button("", () => order("next"), { id: "lig-arm", title: "Next arm (N)" });
  const speedButton = button("", () => {
    const modes = ["fine", "normal", "fast"];
    order("speed", modes[(modes.indexOf(facts.speed) + 1) % modes.length]);
  }, { id: "lig-speed", title: "Speed of keys and sticks (1 2 3)" });
  const themeButton = button("Light", () => theme(), { id: "lig-theme", title: "Light or dark" });
  const helpButton = button("Help", () => help(), { id: "lig-help-button", title: "Keys and words (?)" });
  const touchButton = button("Pad", () => padBox.toggleAttribute("hidden"), { id: "lig-pad-button", title: "Buttons that move the tip" });
  const bar = make("div", { id: "lig-bar", role: "toolbar", "aria-label": "View and hands" },
    swapper, eyesButton, armButton, speedButton, touchButton, themeButton, helpButton);
  const hint = make("p", { id: "lig-hint", role: "status" });
  const hintBox = make("aside", { id: "lig-hints", "aria-label": "Hint", hidden: true },
    hint, button("Got it", () => { finish("all"); }, { id: "lig-hints-off", title: "No more hints" }));

  // --- help with a throw: what to do next, one press each, and the slider of the drive ---------------------------------
  const TOLD = {
    pick: "1 of 3: the needle. Pick it up, or turn the jaw to it and do it by hand.",
    bring: "2 of 3: the needle is in the jaws. Bring it to the tissue.",
    drive: "3 of 3: drive the needle. Pull the slider to the right: its tip goes in along the needle's own arc.",
    hand: "The needle is in the tissue. Go on by hand.",
  };
  const BUSY = { pick: "The arm goes to the needle …", bring: "The arm brings the needle to the tissue …" };
  const asks = (word) => () => { order("assist", word); done("assist"); };
  const told = make("p", { id: "lig-told", role: "status" });
  const picks = button("Pick up the needle", asks("pick"), { id: "lig-pick", class: "lig-first" });
  const aligns = button("Turn the jaw to it", asks("align"), { id: "lig-align" });
  const brings = button("Bring it to the tissue", asks("bring"), { id: "lig-bring", class: "lig-first" });
  const drives = make("input", { type: "range", id: "lig-drive", min: "0", max: "1", step: "0.01", value: "0" });
  let driving = -Infinity, pulled = false;
  drives.addEventListener("input", () => { driving = performance.now(); order("drive", Number(drives.value)); });
  drives.addEventListener("pointerdown", () => { pulled = true; });
  for (const name of ["pointerup", "pointercancel", "blur"]) drives.addEventListener(name, () => { pulled = false; driving = performance.now(); });
  const drive = make("label", { for: "lig-drive" }, "Drive the needle", drives);
  const assistBox = make("section", { id: "lig-assist", "aria-label": "A throw", hidden: true }, told, picks, aligns, brings, drive);
  const assist = () => {
    const { stage = "", busy = false, note = "", driven = 0, inside = false, through = false } = facts.assist ?? {};
    assistBox.hidden = !facts.operates || !stage;
    if (stage !== "drive") driving = -Infinity;
    else if (!pulled && (driving === -Infinity || (!busy && performance.now() - driving > 2000))) drives.value = String(Math.min(Math.max(driven, 0), 1));
    const now = through ? "The needle is through the tissue." : inside ? "The tip is in the tissue: go on." : TOLD[stage] ?? "";
    set(told, (busy && BUSY[stage]) || (!through && note) || now);
    for (const [element, at] of [[picks, "pick"], [aligns, "pick"], [brings, "bring"], [drive, "drive"]]) element.hidden = stage !== at;
    for (const element of [picks, aligns, brings]) element.disabled = busy;
    aims();
  };
  const vector = (name, attributes = {}) => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    return element;
  };
  const aimLine = vector("line"), aimEnd = vector("circle", { r: 9 }), aimText = vector("text");
  const aimBox = vector("svg", { id: "lig-aim", "aria-hidden": "true" });
  aimBox.append(aimLine, aimEnd, aimText);
  const aims = () => { // from the tip to where it has to go, over the large picture of one eye
    const known = facts.operates && facts.aim && eyes === 1 && image.naturalHeight;
    aimBox.style.visibility = known ? "visible" : "hidden";
    if (!large || !known) return;
    const wide = main.clientWidth, high = main.clientHeight, [x1, y1, x2, y2, away, deeper] = facts.aim;
    const tall = Math.min(high, (wide * image.naturalHeight) / image.naturalWidth);
    const at = (x, y) => [wide / 2 + x * tall, high / 2 - y * tall];
    const [a, b] = at(x1, y1), [c, d] = at(x2, y2);
    for (const [key, value] of Object.entries({ x1: a, y1: b, x2: c, y2: d })) aimLine.setAttribute(key, value);
    aimEnd.setAttribute("cx", c); aimEnd.setAttribute("cy", d);
    aimText.setAttribute("x", c + 14); aimText.setAttribute("y", d - 10);
    const depth = Math.abs(deeper) < 1 ? "" : deeper > 0 ? `, ${deeper.toFixed(0)} mm deeper` : `, ${(-deeper).toFixed(0)} mm nearer`;
    set(aimText, `${away.toFixed(0)} mm${depth}`);
  };

  const keyFor = (label, name, axis, way) => {
    const one = button(label, () => {}, { "aria-label": name });
    const down = (event) => { touched.set(one, [axis, way]); one.setPointerCapture?.(event.pointerId); event.preventDefault(); moves(); };
    const up = () => { touched.delete(one); moves(); };
    one.addEventListener("pointerdown", down);
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) one.addEventListener(name, up);
    one.addEventListener("keydown", (event) => { if (event.code === "Enter" && !event.repeat) { touched.set(one, [axis, way]); moves(); } });
    one.addEventListener("keyup", up);
    one.addEventListener("blur", up);
    return one;
  };
  const padBox = make("div", { id: "lig-pad", role: "group", "aria-label": "Move the tip", hidden: !matchMedia("(pointer: coarse)").matches },
    keyFor("↺", "roll left", ROLL, -1), keyFor("↑", "up", UP, 1), keyFor("↻", "roll right", ROLL, 1), keyFor("in", "into the picture", INTO, 1),
    keyFor("←", "left", RIGHT, -1), keyFor("↓", "down", UP, -1), keyFor("→", "right", RIGHT, 1), keyFor("out", "towards you", INTO, -1),
    keyFor("close", "close the jaw", JAW, -1), keyFor("open", "open the jaw", JAW, 1));

  const rows = (pairs) => pairs.map(([what, why]) => make("tr", {}, make("th", { scope: "row" }, what), make("td", {}, why)));
  const closer = button("Close", () => dialog.close(), { class: "lig-first" });
  const dialog = make("dialog", { id: "lig-help", "aria-labelledby": "lig-help-title" },
    make("h2", { id: "lig-help-title" }, "Keys"), make("table", {}, make("tbody", {}, ...rows(HELP))),
    make("h2", {}, "Words"), make("table", {}, make("tbody", {}, ...rows(WORDS))), closer);
  const help = () => { rest(); if (dialog.open) dialog.close(); else { dialog.showModal(); done("help"); } };

  const root = make("div", { id: "lig" }, main, aimBox, welcome, assistBox, hintBox, padBox, bar);
  let watching = false, host = null;

  // --- hints: one at a time, gone for good when done --------------------------------------------------------------------
  const HINTS = [
    ["move", () => `${facts.arm} is yours: hold W A S D to move its tip, Q E for depth, or drag the tip in the camera's picture.`],
    ["jaw", () => "Hold X to open the jaw, Z to close it."],
    ["view", () => "Click the camera's picture, or press V, to work by it."],
    ["help", () => "Press ? for all keys."],
  ];
  const dones = new Set((kept(KEPT.hints) ?? "").split(" "));
  const finish = (name) => { dones.add(name); keep(KEPT.hints, [...dones].join(" ").trim()); update(); };
  const done = (name) => { if (!dones.has(name) && facts.operates) finish(name); };

  const theme = () => {
    const light = kept(KEPT.theme) ? kept(KEPT.theme) !== "light" : document.documentElement.dataset.mantineColorScheme !== "light";
    keep(KEPT.theme, light ? "light" : "dark");
    order("dark", !light);
  };
  const inform = (news) => { facts = news; if (!facts.operates) { held.clear(); touched.clear(); sent = ""; } update(); };
  const set = (element, text) => { if (element.textContent !== text) element.textContent = text; };
  const update = () => {
    root.hidden = !pass; // a page of recorded runs has nothing to operate
    const light = document.documentElement.dataset.mantineColorScheme === "light";
    set(themeButton, light ? "Dark" : "Light");
    welcome.hidden = watching || facts.operates || !facts.free;
    if (large) done("view");
    const next = facts.operates && !dones.has("all") ? HINTS.find(([name]) => !dones.has(name)) : null;
    const text = facts.starting ? "Instruments are powered and homed …" : next && facts.ready ? next[1]() : "";
    set(hint, text);
    hintBox.hidden = !text;
    set(armButton, facts.arm || "no arm");
    set(speedButton, facts.speed || "");
    for (const element of [armButton, speedButton, touchButton]) element.hidden = !facts.operates || !facts.arm;
    swapper.hidden = !facts.eyes;
    eyesButton.hidden = !large || !facts.pair;
    padBox.classList.toggle("off", !facts.operates || !facts.ready);
    assist();
  };

  // --- where it stands: over the 3D view, whatever panels viser has beside it ----------------------------------------------
  const sheet = () => { // on a phone viser's panel is a sheet over the lower half
    let found = document.getElementById("header");
    while (found && found.style.position !== "fixed") found = found.parentElement;
    return found;
  };
  const foldSheet = () => {
    const found = sheet();
    if (found && found.clientHeight > 100) found.querySelector('[style*="cursor: pointer"]')?.click();
  };
  const settle = () => {
    root.classList.toggle("phone", sheet() !== null);
    if (!host?.isConnected) {
      host = document.querySelector("canvas[data-engine]")?.parentElement;
      while (host && host.style.zIndex !== "0") host = host.parentElement;
      host?.parentElement.append(root);
      if (host && large) host.style.display = "none";
    }
    const box = host?.parentElement.getBoundingClientRect();
    if (box) for (const side of ["left", "top", "width", "height"]) root.style[side] = `${box[side]}px`;
  };
  const names = () => {
    for (const button of document.querySelectorAll(".mantine-Notification-closeButton:not([aria-label])")) button.setAttribute("aria-label", "Close");
    for (const button of document.querySelectorAll("button.mantine-ActionIcon-root:not([aria-label])"))
      if (!button.textContent.trim()) button.setAttribute("aria-label", "Connection and display");
    for (const field of document.querySelectorAll("input:not([aria-label]):not([type=hidden])")) {
      if (field.labels?.length) continue;
      let row = field.parentElement;
      while (row && !row.querySelector("label")) row = row.parentElement;
      const name = row?.querySelector("label")?.textContent;
      if (name) field.setAttribute("aria-label", name);
    }
    for (const thumb of document.querySelectorAll("[role=slider]")) {
      let label = null;
      for (let one = thumb; one && !label && !thumb.getAttribute("aria-label"); one = one.parentElement)
        label = one.id && document.querySelector(`label[for="${CSS.escape(one.id)}"]`);
      if (label) thumb.setAttribute("aria-label", label.textContent);
    }
  };
  document.addEventListener("click", (event) => {
    const what = event.target.closest?.("[data-ligature]")?.dataset.ligature;
    if (what === "csv") order("csv");
    if (what === "png") curvesPicture();
  });
  const curvesPicture = () => {
    const charts = [...document.querySelectorAll(".uplot")], gap = 24 * devicePixelRatio;
    const sheets = charts.map((chart) => [chart.querySelector(".u-title")?.textContent ?? "", chart.querySelector("canvas")]);
    const sheet = make("canvas"), pen = sheet.getContext("2d");
    sheet.width = Math.max(...sheets.map(([, one]) => one.width), 1);
    sheet.height = sheets.reduce((sum, [, one]) => sum + one.height + gap, 0) || 1;
    const style = getComputedStyle(document.body);
    pen.fillStyle = style.backgroundColor;
    pen.fillRect(0, 0, sheet.width, sheet.height);
    let y = 0;
    for (const [title, one] of sheets) {
      pen.fillStyle = style.color;
      pen.font = `${14 * devicePixelRatio}px sans-serif`;
      pen.fillText(title, 8, y + 0.75 * gap);
      pen.drawImage(one, 0, y + gap);
      y += one.height + gap;
    }
    sheet.toBlob((blob) => {
      const link = make("a", { href: URL.createObjectURL(blob), download: "ligature-curves.png" });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  };
  document.body.append(dialog);
  setInterval(() => { connect(); settle(); place(); names(); update(); }, 250);
  addEventListener("resize", () => { settle(); sendView(); });
})();
