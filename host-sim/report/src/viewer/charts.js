// Charts over time and by pass, drawn with uPlot. A curve over time is the band between the minimum and the maximum of
// each column, so that peaks remain visible.

const HEIGHT = 230;
const COLUMNS_MAX = 1400;
const LEAST_TICKS = 12; // smallest window, ticks
const PASSES_MAX = 60; // in a window with more passes, one column per pass, so that alternating directions do not blur

// Quantities over time: [name of the series, label, colour, line width].
const OVER_TIME = [
    {
        title: "Speed of cutter contact (CC) and cutter location (CL)",
        unit: "mm/s",
        rows: [["cl_speed", "cutter location (CL)", "violet"], ["cc_speed", "cutter contact (CC)", "warm", 2.5]],
    },
    {
        title: "Velocity of the axes",
        unit: "mm/s",
        limits: "velocity",
        rows: ["x", "y", "z"].map((axis, k) => [`velocity_${axis}`, axis, ["axis-x", "axis-y", "axis-z"][k]]),
    },
    {
        title: "Acceleration of the axes",
        unit: "mm/s²",
        limits: "acceleration",
        rows: ["x", "y", "z"].map((axis, k) => [`acceleration_${axis}`, axis, ["axis-x", "axis-y", "axis-z"][k]]),
    },
    { title: "CL error", unit: "nm", fromZero: true, isMagnitude: true, rows: [["cl_error", "against the oracle", "blue"]] },
    { title: "Feed error", unit: "%", rows: [["feed_error", "against the programmed feed", "blue"]] },
];

// Axes, grid and cursor that all charts share.
function frame(width, unit, more) {
    const ink = variable("ink");
    const axis = (label, size) => ({
        label,
        labelSize: 22,
        labelFont: "14px system-ui, sans-serif",
        font: "13px system-ui, sans-serif",
        size,
        stroke: ink,
        grid: { stroke: variable("grid"), width: 1 },
        ticks: { stroke: variable("axis"), width: 1, size: 5 },
        values: (_, ticks) => tickLabels(ticks),
    });
    return {
        width,
        height: HEIGHT,
        legend: { show: false },
        cursor: { drag: { x: true, y: false, setScale: false }, points: { show: false }, y: false, ...more.cursor },
        padding: [8, 14, 0, 0],
        axes: [{ ...axis(more.across, 34), grid: { show: false } }, axis(unit, 62)],
        ...more.options,
    };
}

// Labels of an axis, with enough decimals to distinguish them.
function tickLabels(ticks) {
    const found = ticks.filter((tick) => tick !== null);
    const step = found.length > 1 ? Math.abs(found[1] - found[0]) : 1;
    const largest = Math.max(...found.map(Math.abs));
    if (largest < 1e-3 && largest > 0) return ticks.map((tick) => (tick === null ? null : tick === 0 ? "0" : shown(tick, 2)));
    const least = Math.max(-Math.floor(Math.log10(step) + 1e-9), 0);
    // A step of 0.0025 needs one decimal more than a step of 0.002.
    const isWhole = (decimals) => Math.abs(step * 10 ** decimals - Math.round(step * 10 ** decimals)) < 1e-6;
    const decimals = isWhole(least) ? least : least + 1;
    return ticks.map((tick) => (tick === null ? null : fixed(tick, decimals)));
}

// A range with margins, optionally from 0.
function airy(low, high, fromZero) {
    if (low === null || high === null || !Number.isFinite(low)) return [0, 1];
    // Values that differ only by rounding are shown as a straight line.
    const air = Math.max(0.08 * (high - low), 1e-3 * Math.max(Math.abs(low), Math.abs(high))) || 1;
    return fromZero ? [0, high + (high - 0) * 0.1 || 1] : [low - air, high + air];
}

const withAlpha = (colour, alpha) => `${colour}${Math.round(255 * alpha).toString(16).padStart(2, "0")}`;

// The elements of a chart: title, read-out, plot.
function card(parent, title, note) {
    const readout = element("span", { class: "values" });
    const plot = element("div", { class: "plot" });
    const figure = element("figure", { class: "chart live", role: "group", "aria-label": title });
    figure.append(element("figcaption", {}, element("b", {}, title), readout), plot);
    if (note) figure.append(element("p", { class: "note" }, note));
    parent.append(figure);
    return { figure, plot, readout };
}

function readings(readout, entries) {
    readout.replaceChildren(
        ...entries.map(([colour, name, text]) =>
            element("span", { class: "key" }, element("i", { class: colour }), `${name} `, element("span", { class: "number" }, text)),
        ),
    );
}

class TimeCharts {
    constructor(payload) {
        this.payload = payload;
        this.panel = null;
        this.series = seriesOf(payload.series);
        const { whole } = this.series;
        this.range = [whole.first, Math.max(whole.end - 1, whole.first + LEAST_TICKS)];
        this.window = [...this.range];
        const last = payload.track.passes.at(-1);
        this.passTicks = last ? last[2] / (last[0] + 1) : Infinity;
        this.cards = OVER_TIME.map((chart) => ({ ...chart, ...card(byId("charts"), `${chart.title}, ${chart.unit}`) }));
        this.buttons();
    }

    // `panel`: the panel of the view, whose time is marked in the charts.
    follow(panel) {
        this.panel = panel;
        const redraw = () => this.cards.forEach(({ chart }) => chart?.redraw(false, false));
        panel.listeners.push(redraw);
        redraw();
    }

    width() {
        return Math.max(this.cards[0].plot.clientWidth, 240);
    }

    build() {
        for (const each of this.cards) {
            each.chart?.destroy();
            each.chart = this.chart(each);
        }
        this.refill();
    }

    chart(each) {
        const L = IsoLibraries.uPlot;
        const colours = each.rows.map(([, , name]) => variable(name));
        const line = (k) => ({ stroke: colours[k], width: each.rows[k][3] ?? 1, pxAlign: 0, points: { show: false }, spanGaps: false });
        const options = frame(this.width(), each.unit, {
            across: "time, s",
            cursor: { sync: { key: "time" } },
            options: {
                scales: {
                    x: { time: false, auto: false, range: () => this.window.map((tick) => tick * this.payload.period) },
                    y: { range: (_, low, high) => airy(low, high, each.fromZero) },
                },
                series: [{}, ...colours.flatMap((_, k) => [line(k), line(k)])],
                bands: colours.map((colour, k) => ({ series: [2 * k + 2, 2 * k + 1], fill: withAlpha(colour, 0.3) })),
                hooks: {
                    setCursor: [(chart) => this.read(each, chart)],
                    setSelect: [(chart) => this.select(chart)],
                    draw: [(chart) => this.marks(each, chart)],
                    ready: [(chart) => this.gestures(chart)],
                },
            },
        });
        return new L(options, [[], ...colours.flatMap(() => [[], []])], each.plot);
    }

    // New data for the window.
    refill() {
        const { period } = this.payload;
        const passes = (this.window[1] - this.window[0]) / this.passTicks;
        const fits = Math.min(Math.round(this.width() * 1.2), COLUMNS_MAX);
        const most = passes > PASSES_MAX ? Math.min(fits, Math.floor(passes)) : fits;
        let shownColumns;
        for (const each of this.cards) {
            const names = each.rows.map(([name]) => name);
            const columns = this.series.columns(names, ...this.window, most);
            each.columns = columns;
            each.chart.setData([columns.times.map((tick) => tick * period), ...columns.rows], false);
            each.chart.setScale("x", { min: this.window[0] * period, max: this.window[1] * period });
            this.read(each, each.chart);
            shownColumns = columns;
        }
        const { samples, pass } = shownColumns;
        const of = pass === undefined ? "" : ` (pass ${pass} is stored in detail)`;
        const from = fixed(this.window[0] * period, 3);
        const to = fixed(this.window[1] * period, 3);
        byId("window").textContent =
            `${from} to ${to} s: ` +
            (samples === 1 ? `every sample is drawn${of}` : `each drawn point spans the least and the largest of ${fixed(samples, 0)} samples${of}`);
    }

    setWindow(from, to) {
        const [low, high] = this.range;
        const length = Math.min(Math.max(to - from, LEAST_TICKS), high - low);
        const begin = Math.min(Math.max(from, low), high - length);
        this.window = [begin, begin + length];
        this.refill();
    }

    zoom(factor, about = (this.window[0] + this.window[1]) / 2) {
        const [from, to] = this.window;
        this.setWindow(about + (from - about) * factor, about + (to - about) * factor);
    }

    // Dragging selects the new window; a click sets the time.
    select(chart) {
        const { left, width } = chart.select;
        const tick = (x) => chart.posToVal(x, "x") / this.payload.period;
        if (width > 4) this.setWindow(tick(left), tick(left + width));
        chart.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    }

    gestures(chart) {
        const { over } = chart;
        let pressed;
        over.addEventListener("mousedown", (event) => (pressed = event.clientX));
        over.addEventListener("click", (event) => {
            if (pressed === undefined || Math.abs(event.clientX - pressed) > 4) return;
            this.panel?.setTick(chart.posToVal(event.clientX - over.getBoundingClientRect().left, "x") / this.payload.period);
        });
        over.addEventListener("dblclick", () => this.setWindow(...this.range));
        over.addEventListener(
            "wheel",
            (event) => {
                // Without Ctrl, the wheel scrolls the page.
                if (!event.ctrlKey && !event.shiftKey && !event.metaKey) return;
                event.preventDefault();
                const about = chart.posToVal(event.clientX - over.getBoundingClientRect().left, "x") / this.payload.period;
                this.zoom((event.deltaY || event.deltaX) > 0 ? 1.3 : 1 / 1.3, about);
            },
            { passive: false },
        );
    }

    // Marks the time, and the axis limits.
    marks(each, chart) {
        const { ctx, bbox } = chart;
        ctx.save();
        ctx.beginPath();
        ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
        ctx.clip();
        if (this.panel?.at) {
            const x = Math.round(chart.valToPos(this.panel.tick * this.payload.period, "x", true)) + 0.5;
            ctx.strokeStyle = variable("ink");
            ctx.globalAlpha = 0.55;
            ctx.lineWidth = devicePixelRatio;
            line(ctx, x, bbox.top, x, bbox.top + bbox.height);
        }
        ctx.globalAlpha = 1;
        const limits = each.limits ? this.payload.limits[each.limits] : undefined;
        limits?.forEach((limit, k) => {
            ctx.strokeStyle = variable(["axis-x", "axis-y", "axis-z"][k]);
            ctx.setLineDash([8, 6]);
            for (const sign of [-1, 1]) {
                const y = chart.valToPos(sign * limit, "y", true);
                line(ctx, bbox.left, y, bbox.left + bbox.width, y);
            }
        });
        ctx.restore();
    }

    read(each, chart) {
        const { times, rows } = each.columns ?? {};
        const index = chart.cursor.idx;
        const isOver = index !== null && index !== undefined && times?.[index] !== undefined && chart.cursor.left >= 0;
        const entries = each.rows.map(([, name, colour], k) => {
            if (!rows) return [colour, name, ""];
            const [low, high] = isOver ? [rows[2 * k][index], rows[2 * k + 1][index]] : extremes(rows[2 * k], rows[2 * k + 1]);
            return [colour, name, each.isMagnitude ? `at most ${shown(high, 4)}` : between(low, high)];
        });
        const { period } = this.payload;
        const when = isOver ? `at ${fixed(times[index] * period, 3)} s` : "in this window";
        readings(each.readout, entries);
        each.readout.append(element("span", { class: "when" }, when));
    }

    buttons() {
        const actions = {
            whole: () => this.setWindow(...this.range),
            pass: () => {
                const pass = this.panel?.at?.pass;
                if (pass) this.setWindow(pass.first, pass.last);
            },
            in: () => this.zoom(0.5),
            out: () => this.zoom(2),
            left: () => this.shift(-0.5),
            right: () => this.shift(0.5),
        };
        for (const button of document.querySelectorAll("[data-window]")) {
            button.addEventListener("click", actions[button.dataset.window]);
        }
        for (const { pass, first, ticks, count } of this.series.details) {
            const button = element("button", { type: "button" }, `Pass ${pass}, in detail`);
            button.addEventListener("click", () => this.setWindow(first, first + ticks * count - 1));
            byId("windows").append(button);
        }
    }

    shift(share) {
        const by = share * (this.window[1] - this.window[0]);
        this.setWindow(this.window[0] + by, this.window[1] + by);
    }
}

function line(ctx, x1, y1, x2, y2) {
    ctx.beginPath();
    ctx.moveTo(x1, y1);
    ctx.lineTo(x2, y2);
    ctx.stroke();
}

// Minimum of one row and maximum of another.
function extremes(lows, highs) {
    const low = lows.reduce((a, b) => (b === null || a < b ? a : b), null);
    return [lows.some((x) => x !== null) ? Math.min(...lows.filter((x) => x !== null)) : low, Math.max(...highs.filter((x) => x !== null), -Infinity)];
}

// A value, or the range between two, with enough digits to distinguish them.
function between(low, high) {
    if (low === null || !Number.isFinite(high)) return "–";
    const apart = high - low;
    const size = Math.max(Math.abs(low), Math.abs(high));
    if (apart <= 1e-7 * size) return shown(high, 5);
    const digits = Math.min(Math.max(Math.ceil(Math.log10(size / apart)) + 2, 4), 9);
    const [a, b] = [shown(low, digits), shown(high, digits)];
    return a === b ? a : `${a} … ${b}`;
}

// Charts by pass, one value per pass.
class PassCharts {
    constructor(payload) {
        const { intervals, scallops, side } = payload;
        const { least, gaps } = intervals;
        const charts = [];
        if (scallops) {
            charts.push({
                title: "Scallop height between adjacent passes, mm",
                unit: "mm",
                across: "gap",
                passes: scallops.gaps,
                rows: [["largest", "warm", columnOf(scallops.largest)], ["mean", "blue", columnOf(scallops.mean)]],
                limit: scallops.limit,
            });
        }
        charts.push(
            { title: `Least interval of each pass, in ${side}`, unit: `interval, in ${side}`, passes: least.pass, rows: [["interval", "blue", least.interval]] },
            {
                title: "Distance from each pass to the next, mm",
                unit: "mm",
                passes: gaps.pass,
                rows: [["at the widest place", "warm", gaps.widest], ["at the narrowest", "blue", gaps.narrowest]],
                band: true,
            },
        );
        // A chart needs at least two points.
        this.cards = charts
            .filter(({ passes }) => passes.length > 1)
            .map((chart) => ({ ...chart, ...card(byId("pass-charts"), chart.title) }));
    }

    build() {
        for (const each of this.cards) {
            each.chart?.destroy();
            each.chart = this.chart(each);
        }
    }

    chart(each) {
        const L = IsoLibraries.uPlot;
        const few = each.passes.length < 80;
        const options = frame(Math.max(each.plot.clientWidth, 240), each.unit, {
            across: each.across ?? "pass",
            cursor: { sync: { key: each.across ?? "pass" }, drag: { x: true, y: false, setScale: true } },
            options: {
                scales: {
                    x: { time: false },
                    // Heights in regions that the ball cannot reach are clipped; they would flatten the others.
                    y: { range: (_, low, high) => airy(low, each.limit ? Math.min(Math.max(high, each.limit), 4 * each.limit) : high, true) },
                },
                series: [
                    {},
                    ...each.rows.map(([, colour]) => ({
                        stroke: variable(colour),
                        width: 1.6,
                        pxAlign: 0,
                        points: { show: few, size: 5, fill: variable(colour) },
                    })),
                ],
                bands: each.band ? [{ series: [1, 2], fill: withAlpha(variable("blue"), 0.18) }] : [],
                hooks: {
                    setCursor: [(chart) => this.read(each, chart)],
                    draw: [(chart) => this.limit(each, chart)],
                    ready: [(chart) => this.read(each, chart)],
                },
            },
        });
        return new L(options, [each.passes, ...each.rows.map(([, , values]) => Array.from(values))], each.plot);
    }

    limit(each, chart) {
        if (each.limit === undefined) return;
        const { ctx, bbox } = chart;
        const y = chart.valToPos(each.limit, "y", true);
        ctx.save();
        ctx.strokeStyle = ctx.fillStyle = variable("bad");
        ctx.lineWidth = devicePixelRatio;
        ctx.setLineDash([8 * devicePixelRatio, 6 * devicePixelRatio]);
        line(ctx, bbox.left, y, bbox.left + bbox.width, y);
        ctx.font = `${13 * devicePixelRatio}px system-ui, sans-serif`;
        ctx.textAlign = "right";
        ctx.fillText("limit", bbox.left + bbox.width - 6 * devicePixelRatio, y - 5 * devicePixelRatio);
        ctx.restore();
    }

    read(each, chart) {
        const index = chart.cursor.idx;
        const isOver = index !== null && index !== undefined && chart.cursor.left >= 0;
        const entries = each.rows.map(([name, colour, values]) => {
            const [low, high] = extentOf(values);
            return [colour, name, isOver ? shown(values[index], 5) : between(low, high)];
        });
        readings(each.readout, entries);
        const when = isOver ? `${each.across ?? "pass"} ${each.passes[index]}` : `over all ${each.across === "gap" ? "gaps" : "passes"}`;
        each.readout.append(element("span", { class: "when" }, when));
    }
}
