// Start of the page: reads the data, builds view and charts, follows size and theme.

function start() {
    const payload = JSON.parse(byId("iso-data").textContent);
    const report = { ready: false, view: null, panel: null, charts: [] };
    window.isofeedReport = report;
    const stage = byId("stage");
    const hasPath = payload.track.passes.length > 0;
    stage.hidden = !hasPath;
    byId("picture").hidden = hasPath;
    document.querySelectorAll(".needs-script").forEach((part) => (part.hidden = false));
    const times = payload.series.whole.count > 1 ? new TimeCharts(payload) : null;
    const passes = new PassCharts(payload);
    const binding = payload.binding.length > 0 ? new BindingChart(payload) : null;
    byId("over-time").hidden = !times;
    byId("by-limit").hidden = !binding;
    byId("by-pass").hidden = passes.cards.length === 0;
    report.charts = [times, passes, binding].filter((charts) => charts !== null);
    const build = () => report.charts.forEach((charts) => charts.build());
    build();
    // Figures and charts are ready before WebGL is initialised.
    requestAnimationFrame(() =>
        setTimeout(() => {
            if (hasPath) openView(payload, report);
            if (report.panel) [times, binding].forEach((charts) => charts?.follow(report.panel));
            follow(report, build);
            report.ready = true;
        }),
    );
}

// The 3D view, or the picture and the reason if the browser cannot draw it.
function openView(payload, report) {
    try {
        // Checked first: three.js would log errors.
        if (!document.createElement("canvas").getContext("webgl2")) throw new Error("no WebGL 2");
        report.view = new View(payload, byId("view"));
    } catch (error) {
        byId("stage").hidden = true;
        byId("picture").hidden = false;
        byId("no-view").hidden = false;
        console.info(`No 3-D view: ${error.message}`);
        return;
    }
    report.panel = new Panel(payload, report.view);
    report.view.dress();
    report.panel.colour(byId("colour").value);
    byId("view").setAttribute("aria-label", byId("picture-words").textContent);
}

function follow(report, build) {
    let width = document.documentElement.clientWidth;
    let waiting;
    if (report.view) new ResizeObserver(() => report.view.resize()).observe(report.view.canvas.parentElement);
    addEventListener("resize", () => {
        if (document.documentElement.clientWidth === width) return;
        width = document.documentElement.clientWidth;
        clearTimeout(waiting);
        waiting = setTimeout(build, 100);
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
        report.view?.dress();
        build();
    });
}

start();
