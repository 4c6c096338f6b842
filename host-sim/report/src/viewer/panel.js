// The controls around the view: colouring and legend, switches, time, read-outs, axis triad and scale bar.

// The colourings.
function colouringsOf(payload, track) {
    const feed = payload.feed;
    const { cc_speed, cl_speed, cl_error, feed_error } = track.values;
    const held = extentOf(cc_speed);
    // The scale of a feed that is constant within 0.1 % would show only rounding.
    const isHeld = held[1] - held[0] < 0.002 * feed;
    const each = "each point: the worst of its samples";
    const colourings = [
        { id: "plain", name: "plain" },
        {
            id: "feed",
            name: "feed (CC)",
            unit: "mm/s",
            on: "lines",
            values: cc_speed,
            worse: (a, b) => Math.abs(a - feed) > Math.abs(b - feed),
            range: isHeld ? [0.95 * feed, 1.05 * feed] : roundRange(...held),
            note: isHeld ? `constant at ${shown(feed)} mm/s, within ${shown(Math.max(...held.map((x) => Math.abs(x / feed - 1))) * 100, 2)} %` : each,
        },
        { id: "centre", name: "speed of the cutter location (CL)", unit: "mm/s", on: "lines", values: cl_speed, range: spread(cl_speed, feed), note: each },
        { id: "error", name: "CL error", unit: "nm", on: "lines", values: cl_error, range: fromZero(cl_error), note: each },
        { id: "feed-error", name: "feed error", unit: "%", on: "lines", values: feed_error, range: fromZero(feed_error), note: each },
    ];
    const { scallops } = payload;
    if (scallops) {
        const values = columnOf(scallops.mesh);
        colourings.splice(1, 0, {
            id: "scallop",
            name: "scallop height",
            unit: "mm",
            on: "surface",
            values,
            range: [0, scallops.limit],
            limit: scallops.limit + scallops.error,
            largest: scallops.highest,
            note: `limit ${scallops.limit} mm; at most ${shown(scallops.highest)} ± ${shown(scallops.error, 2)} mm`,
        });
    }
    return colourings.filter(({ values }) => !values || values.some((value) => !Number.isNaN(value)));
}

const fromZero = (values) => [0, roundRange(0, extentOf(values)[1])[1] || 1];

// The range of speeds, at least 1 % of the feed wide.
function spread(values, feed) {
    const [low, high] = extentOf(values);
    return high - low < 0.01 * feed ? roundRange(low - 0.05 * feed, high + 0.05 * feed) : roundRange(low, high);
}

function legend({ name, unit, range, limit, largest, note }) {
    const low = range[0];
    // Beyond the limit the scale extends to the largest value, in the colour of exceeded limits.
    const isOver = limit !== undefined && largest > limit;
    const high = isOver ? Math.min(Math.max(roundRange(low, largest)[1], 1.1 * range[1]), 1.5 * range[1]) : range[1];
    const share = (range[1] - low) / (high - low);
    const stops = 24;
    const colours = Array.from({ length: stops + 1 }, (_, k) => `${cssColour(colourAt(k / stops))} ${(100 * share * k) / stops}%`);
    if (isOver) colours.push(`${cssColour(OVER)} ${100 * share}%`);
    const bar = element("div", { class: "ramp", style: `background:linear-gradient(90deg,${colours.join(",")})` });
    const at = (value) => `left:${(100 * (value - low)) / (high - low)}%`;
    if (limit !== undefined) bar.append(element("i", { class: "mark", style: at(range[1]) }));
    const { ticks, label } = ticksIn(low, high, 4);
    const scale = element("div", { class: "ticks" }, ...ticks.map((tick) => element("span", { style: at(tick) }, label(tick))));
    const title = name[0].toUpperCase() + name.slice(1);
    byId("legend").replaceChildren(element("b", {}, `${title}, ${unit}`), bar, scale, element("small", {}, note));
}

// The legend of the lines in the plain view.
function key() {
    const entry = (colour, text) => element("span", { class: "key" }, element("i", { class: colour }), text);
    byId("legend").replaceChildren(
        entry("blue", "passes, cutter contact (CC)"),
        entry("warm", "this pass"),
        entry("violet", "cutter location (CL)"),
        entry("green", "links, home, safe height"),
    );
}

class Panel {
    constructor(payload, view) {
        this.payload = payload;
        this.view = view;
        this.colourings = colouringsOf(payload, view.track);
        this.listeners = [];
        this.fillColours();
        this.switches();
        this.views();
        this.marks();
        this.keys();
        this.timeline();
        this.pointing();
        view.after.push(() => this.furniture());
    }

    fillColours() {
        const select = byId("colour");
        select.append(...this.colourings.map(({ id, name }) => element("option", { value: id }, name)));
        select.value = this.payload.scallops ? "scallop" : "plain";
        select.addEventListener("change", () => this.colour(select.value));
    }

    colour(id) {
        const colouring = this.colourings.find((each) => each.id === id) ?? this.colourings[0];
        byId("colour").value = colouring.id;
        byId("legend").hidden = false;
        if (colouring.on) legend(colouring);
        else key();
        this.view.paint(colouring.on ? colouring : null);
    }

    switches() {
        const ball = byId("show-ball");
        // A ball as large as the part would cover it.
        ball.checked = this.payload.radius < 0.4 * this.view.diagonal;
        const { setting } = this.view;
        const has = { links: setting.hasLinks, machine: setting.hasMachine, setup: setting.hasSetup, marks: setting.marks.length > 0 };
        for (const [name, there] of Object.entries(has)) byId(`show-${name}`).parentElement.hidden = !there;
        const shows = (name) => has[name] && byId(`show-${name}`).checked;
        const update = () => {
            this.view.show({
                surface: byId("show-surface").checked,
                passes: byId("show-passes").checked,
                centres: byId("centres").value,
                ball: ball.checked,
            });
            setting.show({ links: shows("links"), machine: shows("machine"), setup: shows("setup"), marks: shows("marks"), body: true });
        };
        this.shows = shows;
        for (const id of ["show-surface", "show-passes", "show-ball", "show-links", "show-machine", "show-setup", "show-marks", "centres"]) byId(id).addEventListener("change", update);
        update();
    }

    // The marks: a label at each place, and a button that brings the tool there.
    marks() {
        const { marks } = this.view.setting;
        const row = byId("marks");
        row.hidden = marks.length === 0;
        marks.forEach((mark, k) => {
            mark.tag = element("span", { class: "tag bad" }, `${k + 1}`);
            byId("mark-tags").append(mark.tag);
            const button = element("button", { type: "button" }, `${k + 1} ${mark.what}`);
            button.addEventListener("click", () => {
                if (mark.tick !== null) this.setTick(mark.tick);
                this.view.request();
            });
            row.append(button);
        });
    }

    views() {
        const directions = { home: this.payload.toward, all: this.payload.toward, top: [0, 0, 1], front: [0, -1, 0], right: [1, 0, 0] };
        for (const button of document.querySelectorAll("[data-view]")) {
            button.addEventListener("click", () =>
                this.view.look(directions[button.dataset.view], button.dataset.view === "all"),
            );
        }
    }

    keys() {
        const { view } = this;
        const turn = 0.12;
        const actions = {
            ArrowLeft: () => view.turn(-turn, 0),
            ArrowRight: () => view.turn(turn, 0),
            ArrowUp: () => view.turn(0, -turn),
            ArrowDown: () => view.turn(0, turn),
            "+": () => view.zoomBy(1.25),
            "=": () => view.zoomBy(1.25),
            "-": () => view.zoomBy(0.8),
            Home: () => view.look(this.payload.toward),
        };
        view.canvas.addEventListener("keydown", (event) => {
            const action = actions[event.key];
            if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
            event.preventDefault();
            action();
        });
    }

    timeline() {
        const { track } = this.view;
        const first = track.passes[0];
        const last = track.passes[track.passes.length - 1];
        this.ticks = [first?.first ?? 0, last?.last ?? 0];
        const slider = byId("time");
        [slider.min, slider.max] = this.ticks;
        slider.addEventListener("input", () => this.setTick(Number(slider.value)));
        const speed = byId("speed");
        const whole = (this.ticks[1] - this.ticks[0]) * track.period;
        // Speeds from real time to the whole run in about 30 s.
        const factors = [1, 5, 20, 100, 500].filter((factor) => factor === 1 || whole / factor > 5);
        speed.append(...factors.map((factor) => element("option", { value: factor }, `${factor}×`)));
        speed.value = factors.filter((factor) => factor === 1 || whole / factor > 60).pop();
        const play = byId("play");
        play.addEventListener("click", () => (this.playing ? this.pause() : this.play()));
        // At the first mark, else in the middle.
        const marked = this.view.setting.marks.find(({ tick }) => tick !== null);
        const middle = track.passes[Math.floor(track.passes.length / 2)];
        this.setTick(marked ? marked.tick : middle ? Math.round((middle.first + middle.last) / 2) : 0);
    }

    play() {
        if (this.tick >= this.ticks[1]) this.setTick(this.ticks[0]);
        this.playing = true;
        byId("play").textContent = "❚❚";
        byId("play").setAttribute("aria-label", "Pause");
        let before;
        const step = (now) => {
            if (!this.playing) return;
            const seconds = before === undefined ? 0 : (now - before) / 1000;
            before = now;
            const tick = this.tick + (seconds * Number(byId("speed").value)) / this.payload.period;
            this.setTick(Math.min(tick, this.ticks[1]));
            if (this.tick >= this.ticks[1]) this.pause();
            else requestAnimationFrame(step);
        };
        requestAnimationFrame(step);
    }

    pause() {
        this.playing = false;
        byId("play").textContent = "▶";
        byId("play").setAttribute("aria-label", "Play");
    }

    // Sets the time of view, charts and read-outs.
    setTick(tick) {
        this.tick = Math.min(Math.max(tick, this.ticks[0]), this.ticks[1]);
        byId("time").value = this.tick;
        if (this.view.track.passes.length === 0) return;
        this.at = this.view.moveTo(this.tick);
        this.read();
        this.listeners.forEach((listener) => listener(this.tick));
    }

    read() {
        const { at, payload, view } = this;
        const place = (mm) => mm.map((x, k) => fixed(x + view.origin[k], 3)).join(", ");
        const { values } = view.track;
        const value = (name, unit, digits) => `${shown(values[name][at.point], digits)} ${unit}`;
        const entries = [
            ["Time", `${fixed(this.tick * payload.period, 3)} s`],
            ["Pass", `${at.pass.pass}`],
            ["CC, mm", place(at.cc)],
            ["CL, mm", place(at.cl)],
            ["Feed", value("cc_speed", "mm/s", 5)],
            ["CL speed", value("cl_speed", "mm/s", 5)],
            ["CL error", value("cl_error", "nm", 3)],
        ];
        byId("time").setAttribute("aria-valuetext", `${entries[0][1]}, pass ${entries[1][1]}`);
        byId("readout").replaceChildren(
            ...entries.map(([name, text]) => element("div", {}, element("dt", {}, name), element("dd", {}, text))),
        );
    }

    // The foremost point of a drawn pass near a pixel.
    pointNear(x, y) {
        const { view } = this;
        const { cc, ticks } = view.track;
        const reach = 7;
        view.camera.updateMatrixWorld();
        const matrix = view.camera.projectionMatrix.clone().multiply(view.camera.matrixWorldInverse).elements;
        let best;
        for (let k = 0; k < ticks.length; k++) {
            const [a, b, c] = [cc[3 * k], cc[3 * k + 1], cc[3 * k + 2]];
            const row = (r) => matrix[r] * a + matrix[4 + r] * b + matrix[8 + r] * c + matrix[12 + r];
            const dx = ((row(0) + 1) / 2) * view.width - x;
            const dy = ((1 - row(1)) / 2) * view.height - y;
            const away = dx * dx + dy * dy;
            if (away > reach * reach) continue;
            // Weighs the distance in pixels against the depth.
            const score = row(2) + 0.002 * Math.sqrt(away);
            if (!best || score < best.score) best = { score, point: k };
        }
        return best?.point;
    }

    pointing() {
        const { canvas, track } = this.view;
        const tip = byId("tip");
        let pressed;
        const place = (event) => {
            const box = canvas.getBoundingClientRect();
            return [event.clientX - box.left, event.clientY - box.top];
        };
        canvas.addEventListener("pointermove", (event) => {
            if (event.buttons || event.pointerType === "touch") return (tip.hidden = true);
            const [x, y] = place(event);
            const point = byId("show-passes").checked ? this.pointNear(x, y) : undefined;
            tip.hidden = point === undefined;
            if (point === undefined) return undefined;
            tip.textContent = this.describe(point);
            tip.style.left = `${Math.min(x + 14, this.view.width - tip.offsetWidth - 6)}px`;
            tip.style.top = `${Math.max(y - tip.offsetHeight - 10, 4)}px`;
            return undefined;
        });
        canvas.addEventListener("pointerleave", () => (tip.hidden = true));
        canvas.addEventListener("pointerdown", (event) => (pressed = place(event)));
        canvas.addEventListener("pointerup", (event) => {
            const [x, y] = place(event);
            if (!pressed || Math.hypot(x - pressed[0], y - pressed[1]) > 4 || event.button !== 0) return;
            const point = this.pointNear(x, y);
            if (point !== undefined) this.setTick(track.ticks[point]);
        });
    }

    describe(point) {
        const { track } = this.view;
        const { passes, ticks, values, period } = track;
        const pass = passes[track.passAt(ticks[point])];
        const count = pass.stride > 1 ? ` (worst of ${pass.stride} samples)` : "";
        return (
            `pass ${pass.pass}, ${fixed(ticks[point] * period, 3)} s\n` +
            `feed ${shown(values.cc_speed[point], 5)} mm/s, off by ${shown(values.feed_error[point], 2)} %\n` +
            `CL ${shown(values.cl_speed[point], 4)} mm/s, off by ${shown(values.cl_error[point], 3)} nm${count}`
        );
    }

    // Updates axis triad, scale bar and labels after the view was drawn.
    furniture() {
        const { view } = this;
        const arm = 30;
        const taken = [];
        const lines = view
            .axes()
            .map(([right, up, toward], k) => ({ right, up, toward, name: "xyz"[k] }))
            .sort((a, b) => a.toward - b.toward)
            .map(({ right, up, name }) => {
                const [x, y] = [arm * right, -arm * up];
                const far = Math.hypot(x, y) < 6 ? 0 : 1 + 11 / Math.hypot(x, y);
                const place = [x * far, y * far];
                // Labels must not overlap.
                const other = taken.find(([a, b]) => Math.hypot(place[0] - a, place[1] - b) < 13);
                if (other) place[0] = other[0] + (place[0] < other[0] ? -11 : 11);
                taken.push(place);
                const text = far ? `<text x="${place[0]}" y="${place[1] + 4.5}">${name}</text>` : "";
                return `<line class="${name}" x2="${x}" y2="${y}"/>${text}`;
            });
        byId("triad").innerHTML = `${lines.join("")}<circle r="2.5"/>`;
        const most = Math.min(150, view.width / 4);
        const above = roundAbove(most / view.pixels());
        const length = above * view.pixels() <= most * 1.001 ? above : [0.5, 0.4, 0.2, 0.1].map((k) => k * above).find((k) => k * view.pixels() <= most && roundAbove(k) - k < 1e-9 * k);
        byId("scale-bar").style.width = `${length * view.pixels()}px`;
        byId("scale-bar").firstChild.textContent = length < 1 ? `${shown(length * 1000, 1)} µm` : `${shown(length, length >= 1000 ? 4 : 1)} mm`;
        const { setting } = view;
        const label = (tag, at, visible) => {
            tag.hidden = !visible;
            if (!visible) return;
            const [x, y] = view.pixel(at);
            tag.style.transform = `translate(${x + 8}px,${y - 16}px)`;
        };
        label(byId("tag-home"), setting.home, this.shows("machine") && setting.home);
        label(byId("tag-safe"), setting.safeCorner, this.shows("machine") && setting.safeCorner);
        for (const mark of setting.marks) label(mark.tag, mark.at, this.shows("marks"));
        const shows = byId("show-ball").checked && this.at;
        for (const [id, name] of [["tag-cc", "cc"], ["tag-cl", "cl"]]) {
            const tag = byId(id);
            tag.hidden = !shows;
            if (!shows) continue;
            // Each label is outside of its end of the radius, so that the two do not overlap.
            const [x, y] = view.pixel(this.at[name]);
            const [otherX, otherY] = view.pixel(this.at[name === "cc" ? "cl" : "cc"]);
            const [dx, dy] = [x - otherX, y - otherY];
            const apart = Math.hypot(dx, dy);
            const [right, down] = apart > 1 ? [dx / apart, dy / apart] : [0.7, name === "cc" ? 0.7 : -0.7];
            tag.style.transform = `translate(${x + 18 * right}px,${y + 15 * down}px) translate(-50%,-50%)`;
        }
    }
}
