// The speed of one pass as emitted, beside the fastest motion within the limits, drawn by the limit that binds it.

// Names of the limits by their index: the feed, then velocity, acceleration and jerk of x, y, z.
const BINDING = [
    { name: "the programmed feed", short: "feed", colour: "blue", dash: [] },
    ...[["velocity", "vel.", [2, 3]], ["acceleration", "acc.", []], ["jerk", "jerk", [9, 4]]].flatMap(([what, brief, dash]) =>
        ["x", "y", "z"].map((axis) => ({ name: `${what} of ${axis}`, short: `${brief} ${axis}`, colour: `axis-${axis}`, dash })),
    ),
];
const BINDS_FROM = 0.95; // share of a limit from which it binds
const LABEL_LEAST = 44; // least width of a stretch with a label, pixels

class BindingChart {
    constructor(payload) {
        this.payload = payload;
        this.panel = null;
        this.passes = payload.binding.map((pass) => ({
            ...pass,
            binds: wordsOf(pass.binds),
            ...Object.fromEntries(["arc", "limit", "share", "time", "least", "largest"].map((name) => [name, columnOf(pass[name])])),
        }));
        this.select = byId("binding-pass");
        for (const [index, { pass, ours, optimum }] of this.passes.entries()) {
            this.select.append(element("option", { value: index }, `${pass}: ${fixed(ours, 3)} s, optimum ${fixed(optimum, 3)} s`));
        }
        this.card = card(byId("binding-chart"), "Speed of the cutter contact against the limit that binds, mm/s");
        this.legend = element("p", { class: "note key-line" });
        this.card.figure.append(this.legend);
        this.select.addEventListener("change", () => this.build());
        // The pass that loses most is shown first.
        const worst = this.passes.reduce((best, pass, k) => (pass.ours / pass.optimum > this.passes[best].ours / this.passes[best].optimum ? k : best), 0);
        this.select.value = worst;
    }

    get pass() {
        return this.passes[Number(this.select.value)];
    }

    follow(panel) {
        this.panel = panel;
        panel.listeners.push(() => this.chart?.redraw(false, false));
        this.chart?.redraw(false, false);
    }

    build() {
        this.chart?.destroy();
        const { pass } = this;
        const ink = variable("ink");
        const emitted = { stroke: ink, width: 1.3, pxAlign: 0, points: { show: false } };
        const hidden = { stroke: "transparent", width: 0, points: { show: false } };
        const options = frame(Math.max(this.card.plot.clientWidth, 240), "mm/s", {
            across: "way of the contact on the pass, mm",
            cursor: { drag: { x: true, y: false, setScale: true } },
            options: {
                height: 280,
                scales: { x: { time: false }, y: { range: (_, low, high) => [0, 1.12 * Math.max(high, this.payload.feed)] } },
                series: [{}, emitted, emitted, hidden],
                bands: [{ series: [2, 1], fill: withAlpha(ink, 0.25) }],
                hooks: {
                    setCursor: [() => this.read()],
                    // Below the emitted speed.
                    drawAxes: [(chart) => this.limits(chart)],
                    draw: [(chart) => this.time(chart)],
                    ready: [(chart) => this.gestures(chart)],
                },
            },
        });
        const { arc, least, largest, limit } = pass;
        this.chart = new IsoLibraries.uPlot(options, [arc, least, largest, limit].map((row) => Array.from(row)), this.card.plot);
        this.keys();
        this.read();
    }

    gestures(chart) {
        let pressed;
        chart.over.addEventListener("mousedown", (event) => (pressed = event.clientX));
        chart.over.addEventListener("click", (event) => {
            if (pressed === undefined || Math.abs(event.clientX - pressed) > 4) return;
            const { idx } = chart.cursor;
            if (idx !== null && idx !== undefined) this.panel?.setTick(this.pass.ticks[idx]);
        });
    }

    // Stretches of one limit: [limit, first point, last point].
    stretches() {
        const { binds } = this.pass;
        const found = [];
        for (let k = 0; k < binds.length; k++) {
            const last = found.at(-1);
            if (last && last[0] === binds[k]) last[2] = k;
            else found.push([binds[k], k, k]);
        }
        return found;
    }

    // Draws within the plot. `draw` gets the canvas, its box, and the places of a point's arc and of a speed.
    within(chart, draw) {
        const { ctx, bbox } = chart;
        ctx.save();
        ctx.beginPath();
        ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
        ctx.clip();
        const x = (k) => chart.valToPos(this.pass.arc[k], "x", true);
        draw(ctx, bbox, x, (speed) => chart.valToPos(speed, "y", true));
        ctx.restore();
    }

    // The programmed feed, and the fastest motion by what binds.
    limits(chart) {
        this.within(chart, (ctx, bbox, x, y) => this.stretchLines(ctx, bbox, x, y));
    }

    stretchLines(ctx, bbox, x, y) {
        const { pass } = this;
        const ratio = devicePixelRatio;
        ctx.strokeStyle = variable("ink");
        ctx.lineWidth = ratio;
        ctx.setLineDash([4 * ratio, 4 * ratio]);
        line(ctx, bbox.left, y(this.payload.feed), bbox.left + bbox.width, y(this.payload.feed));
        ctx.font = `600 ${12 * ratio}px system-ui, sans-serif`;
        ctx.textAlign = "center";
        let free = bbox.left;
        for (const [limit, first, last] of this.stretches()) {
            const { colour, dash, short } = BINDING[limit];
            ctx.strokeStyle = ctx.fillStyle = variable(colour);
            ctx.lineWidth = 4 * ratio;
            ctx.setLineDash(dash.map((length) => length * ratio));
            ctx.beginPath();
            // A stretch reaches to the next one.
            const end = Math.min(last + 1, pass.arc.length - 1);
            for (let k = first; k <= end; k++) ctx.lineTo(x(k), y(pass.limit[k]));
            ctx.stroke();
            const from = Math.max(x(first), bbox.left);
            const to = Math.min(x(end), bbox.left + bbox.width);
            if (to - from > LABEL_LEAST * ratio && from >= free) {
                const highest = Math.min(...pass.limit.slice(first, end + 1).map(y));
                ctx.fillText(short, 0.5 * (from + to), highest - 8 * ratio);
                free = 0.5 * (from + to) + LABEL_LEAST * ratio * 0.5;
            }
        }
    }

    // Marks the time, if the tool is on this pass.
    time(chart) {
        const { pass, panel } = this;
        if (panel?.at?.pass.pass !== pass.pass) return;
        this.within(chart, (ctx, bbox, x) => {
            const k = pass.ticks.findIndex((tick) => tick >= panel.tick);
            ctx.strokeStyle = variable("ink");
            ctx.globalAlpha = 0.55;
            ctx.lineWidth = devicePixelRatio;
            const place = Math.round(x(k < 0 ? pass.arc.length - 1 : k)) + 0.5;
            line(ctx, place, bbox.top, place, bbox.top + bbox.height);
        });
    }

    // What binds over the pass, by the share of the fastest motion's time.
    shares() {
        const { binds, time } = this.pass;
        const shares = BINDING.map(() => 0);
        binds.forEach((limit, k) => (shares[limit] += time[k]));
        return shares.map((share, limit) => [limit, share]).filter(([, share]) => share > 0).sort((a, b) => b[1] - a[1]);
    }

    keys() {
        const key = (colour, text, dash) =>
            element("span", { class: "key" }, element("i", { class: `${colour}${dash?.length ? (dash[0] < 4 ? " dotted" : " dashed") : ""}` }), text);
        const limits = this.shares().map(([limit, share]) => {
            const { name, colour, dash } = BINDING[limit];
            return key(colour, `${name} ${share < 0.01 ? "< 1" : fixed(100 * share, 0)} %`, dash);
        });
        const { periods } = this.pass;
        const grouped = periods > 1 ? ` A point stands for ${periods} periods, with the least speed of the limit.` : "";
        this.legend.replaceChildren(key("ink", "as emitted"), ...limits, ` of the fastest motion's time.${grouped}`);
    }

    // What binds at a point, in words.
    words(k) {
        const { binds, share, limit } = this.pass;
        const { name } = BINDING[binds[k]];
        const { feed } = this.payload;
        const speed = `${shown(limit[k], 3)} mm/s`;
        if (share[k] < BINDS_FROM) return `between limits, most of all ${name} (${fixed(100 * share[k], 0)} %): ${speed} of ${shown(feed, 3)}`;
        return binds[k] === 0 ? `${name} binds: ${shown(feed, 3)} mm/s` : `${name} binds: ${speed} of ${shown(feed, 3)}`;
    }

    read() {
        const { chart, pass, card: { readout } } = this;
        const index = chart?.cursor.idx;
        const isOver = index !== null && index !== undefined && chart.cursor.left >= 0;
        if (!isOver) {
            readings(readout, []);
            const above = 100 * (pass.ours / pass.optimum - 1);
            readout.append(element("span", { class: "when" }, `pass ${pass.pass}: ${fixed(pass.ours, 3)} s, ${above < 0 ? "" : "+"}${fixed(above, 2)} % over the fastest motion found`));
            return;
        }
        const { colour } = BINDING[pass.binds[index]];
        readings(readout, [
            [colour, this.words(index), ""],
            ["ink", "emitted", `${between(pass.least[index], pass.largest[index])} mm/s`],
        ]);
        readout.append(element("span", { class: "when" }, `at ${fixed(pass.arc[index], 2)} mm`));
    }
}
