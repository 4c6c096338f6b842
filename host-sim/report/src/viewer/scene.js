// The view: surface, passes, tool path and ball, drawn with three.js when something has changed.

const LIFT = 0.0007; // of the box's diagonal: offset of lines from the surface, against depth fighting
const WIDTH = { pass: 1.2, centre: 1.2, one: 3.2 }; // pixels
const DOT = 4.5; // pixels
const SEGMENT = 8; // pixels: approximate length of line segments; zooming refines them
const LIGHT = [-0.5, 0.75, 1]; // direction to the light: right, up, towards the viewer

class View {
    constructor(payload, canvas) {
        const L = IsoLibraries;
        this.L = L;
        this.canvas = canvas;
        this.payload = payload;
        const { low, step } = payload.box;
        this.extent = View.boxOf(payload);
        this.middle = this.extent.low.map((a, k) => (a + this.extent.high[k]) / 2);
        this.origin = low.map((a, k) => a + this.middle[k]);
        this.size = this.extent.high.map((b, k) => b - this.extent.low[k]);
        this.diagonal = Math.hypot(...this.size) || 1;
        this.track = trackOf(payload, this.middle);
        this.renderer = new L.WebGLRenderer({ canvas, antialias: true, alpha: true });
        this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
        this.scene = new L.Scene();
        this.camera = new L.OrthographicCamera(-1, 1, 1, -1, 0.01, 10 * this.diagonal);
        this.camera.up.set(0, 0, 1);
        this.addLights();
        this.addSurface(step);
        this.addLines();
        this.addTool();
        this.setting = new Setting(this, payload.setting);
        this.controls = new L.OrbitControls(this.camera, canvas);
        Object.assign(this.controls, { enableDamping: false, zoomToCursor: true, minZoom: 0.2, maxZoom: 400 });
        this.controls.addEventListener("change", () => this.request());
        this.after = [];
        this.look(payload.toward);
    }

    // Bounding box of surface and tool path, mm, from its lowest corner.
    static boxOf({ mesh, track, box }) {
        const low = [Infinity, Infinity, Infinity];
        const high = [-Infinity, -Infinity, -Infinity];
        for (const text of [mesh.points, track.cl]) {
            wordsOf(text).forEach((word, k) => {
                low[k % 3] = Math.min(low[k % 3], word * box.step);
                high[k % 3] = Math.max(high[k % 3], word * box.step);
            });
        }
        return { low, high };
    }

    addLights() {
        const { AmbientLight, DirectionalLight } = this.L;
        this.ambient = new AmbientLight(0xffffff, 1);
        this.light = new DirectionalLight(0xffffff, 2);
        this.light.position.set(...LIGHT);
        // The light moves with the camera.
        this.camera.add(this.light, this.light.target);
        this.light.target.position.set(0, 0, 0);
        this.scene.add(this.ambient, this.camera);
    }

    addSurface(step) {
        const { BufferAttribute, BufferGeometry, Mesh, MeshLambertMaterial } = this.L;
        const { cells, sign, points } = this.payload.mesh;
        const [rows, columns] = cells;
        const indices = new Uint32Array(rows * columns * 6);
        let at = 0;
        for (let i = 0; i < rows; i++) {
            for (let j = 0; j < columns; j++) {
                const a = i * (columns + 1) + j;
                const b = a + columns + 1;
                const corners = sign > 0 ? [a, b, b + 1, a, b + 1, a + 1] : [a, b + 1, b, a, a + 1, b + 1];
                indices.set(corners, at);
                at += 6;
            }
        }
        const geometry = new BufferGeometry();
        geometry.setAttribute("position", new BufferAttribute(placesOf(points, step, this.middle), 3));
        geometry.setIndex(new BufferAttribute(indices, 1));
        geometry.computeVertexNormals();
        const count = (rows + 1) * (columns + 1);
        geometry.setAttribute("color", new BufferAttribute(new Float32Array(3 * count).fill(1), 3));
        const offset = { polygonOffset: true, polygonOffsetFactor: 1.5, polygonOffsetUnits: 4 };
        // The tool side and the back: FrontSide is 0, BackSide 1.
        this.front = new MeshLambertMaterial({ ...offset, side: 0, vertexColors: true });
        this.back = new MeshLambertMaterial({ ...offset, side: 1 });
        this.surface = geometry;
        this.faces = [new Mesh(geometry, this.front), new Mesh(geometry, this.back)];
        this.scene.add(...this.faces);
    }

    // Line segments between the points of passes; those of the contact are offset from the surface towards the centre.
    segments(passes, places, times = 1) {
        const positions = [];
        const { cc, cl } = this.track;
        const lift = places === cc ? (times * LIFT * this.diagonal) / this.payload.radius : 0;
        this.eachPiece(passes, (...ends) => {
            for (const point of ends) {
                for (let k = 3 * point; k < 3 * point + 3; k++) {
                    positions.push(places[k] + lift * (cl[k] - cc[k]));
                }
            }
        });
        return positions.length ? new Float32Array(positions) : new Float32Array(6);
    }

    // The line segments of the passes, with a length that depends on the zoom.
    eachPiece(passes, each) {
        for (const { begin, count } of passes) {
            const last = begin + count - 1;
            for (let point = begin; point < last; point += this.stride) {
                each(point, Math.min(point + this.stride, last));
            }
        }
    }

    // Points per line segment: a power of two.
    wantedStride() {
        if (this.step === undefined) {
            let [sum, count] = [0, 0];
            const { passes, cc } = this.track;
            for (const pass of passes) {
                for (let at = 3 * pass.begin + 3; at < 3 * (pass.begin + pass.count); at += 3) {
                    sum += Math.hypot(cc[at] - cc[at - 3], cc[at + 1] - cc[at - 2], cc[at + 2] - cc[at - 1]);
                    count++;
                }
            }
            this.step = count ? sum / count : 0;
        }
        const pixels = this.step * this.pixels();
        return pixels > 0 ? 2 ** Math.min(Math.max(Math.round(Math.log2(SEGMENT / pixels)), 0), 10) : 1;
    }

    // Rebuilds the line segments if the zoom requires another length.
    refine() {
        const stride = this.wantedStride();
        if (stride === this.stride) return;
        this.stride = stride;
        const { passes, cc, cl } = this.track;
        for (const [line, places] of [[this.passes, cc], [this.centres, cl]]) {
            line.geometry.dispose();
            line.geometry = this.geometry(this.segments(passes, places));
            if (this.colouring?.on === "lines") line.geometry.setColors(this.lineColours(this.colouring));
        }
        this.one?.forEach((line, k) => {
            line.geometry.dispose();
            line.geometry = this.geometry(this.segments([passes[this.one.pass]], k === 0 ? cc : cl, 3));
        });
    }

    geometry(positions) {
        return new this.L.LineSegmentsGeometry().setPositions(positions);
    }

    line(positions, width, more = {}) {
        const { LineMaterial, LineSegments2 } = this.L;
        const line = new LineSegments2(this.geometry(positions), new LineMaterial({ linewidth: width, ...more }));
        line.frustumCulled = false;
        return line;
    }

    addLines() {
        const { passes, cc, cl } = this.track;
        this.stride = 1024;
        this.passes = this.line(this.segments(passes, cc), WIDTH.pass, { transparent: true });
        this.centres = this.line(this.segments(passes, cl), WIDTH.centre, { transparent: true });
        this.scene.add(this.passes, this.centres);
        this.one = null;
    }

    addTool() {
        const { Group, Mesh, MeshBasicMaterial, MeshPhongMaterial, SphereGeometry } = this.L;
        this.tool = new Group();
        const ball = new Mesh(
            new SphereGeometry(this.payload.radius, 64, 48),
            new MeshPhongMaterial({ transparent: true, opacity: 0.5, shininess: 60, depthWrite: false }),
        );
        ball.renderOrder = 3;
        const dot = () => {
            const made = new Mesh(new SphereGeometry(1, 20, 14), new MeshBasicMaterial({ transparent: true }));
            made.renderOrder = 4;
            return made;
        };
        this.ball = ball;
        this.dots = { cc: dot(), cl: dot() };
        this.radius = this.line(new Float32Array(6), 1.6, { transparent: true });
        this.radius.renderOrder = 4;
        this.tool.add(ball, this.dots.cc, this.dots.cl, this.radius);
        this.scene.add(this.tool);
    }

    // Applies the colours of the theme.
    dress() {
        const set = (colour, name) => colour.setStyle(variable(name));
        this.surfaceColour = variable("surface");
        this.setting.dress();
        set(this.back.color, "surface-back");
        set(this.ball.material.color, "ball");
        this.ball.material.specular.setStyle("#555");
        set(this.dots.cc.material.color, "warm");
        set(this.dots.cl.material.color, "violet");
        set(this.radius.material.color, "ink");
        this.paint(this.colouring ?? null);
        if (this.tick !== undefined) {
            this.one?.forEach((line) => line.removeFromParent());
            this.one = null;
            this.moveTo(this.tick);
        }
    }

    // Colours lines or the surface by the values of their points; null: plain.
    // colouring: { on: "lines" | "surface", values, range, limit }
    paint(colouring) {
        this.colouring = colouring;
        const onSurface = colouring?.on === "surface";
        const { Color } = this.L;
        const colours = this.surface.getAttribute("color");
        if (onSurface) this.fill(colours.array, colouring);
        else colours.array.fill(1);
        colours.needsUpdate = true;
        this.front.color.setStyle(onSurface ? "#ffffff" : this.surfaceColour);
        // On a coloured surface the shading is weak, so that the colours match the scale.
        this.ambient.intensity = onSurface ? 2.3 : 1.15;
        this.light.intensity = onSurface ? 0.9 : 2.1;
        const onLines = colouring?.on === "lines";
        for (const [line, name] of [[this.passes, "blue"], [this.centres, "violet"]]) {
            const material = line.material;
            material.vertexColors = onLines;
            if (onLines) {
                material.color = new Color(1, 1, 1);
                line.geometry.setColors(this.lineColours(colouring));
            } else {
                material.color = new Color().setStyle(onSurface ? variable("on-scale") : variable(name));
            }
            material.opacity = 1;
            material.depthWrite = onLines;
            material.needsUpdate = true;
        }
        this.request();
    }

    // Opacity of the lines: dense lines are fainter, so that they do not hide the surface.
    opacity() {
        const apart = (this.spacing ??= this.meanSpacing()) * this.pixels();
        return Math.min(Math.max(apart / 9, 0.16), 0.9);
    }

    // Mean distance between the middles of adjacent drawn passes, mm.
    meanSpacing() {
        const { passes, cc } = this.track;
        let sum = 0;
        for (let k = 1; k < passes.length; k++) {
            const [a, b] = [passes[k - 1], passes[k]].map(({ begin, count }) => 3 * (begin + (count >> 1)));
            sum += Math.hypot(cc[a] - cc[b], cc[a + 1] - cc[b + 1], cc[a + 2] - cc[b + 2]);
        }
        return passes.length > 1 ? sum / (passes.length - 1) : this.diagonal;
    }

    // Adapts width and opacity of the lines to the zoom.
    fade() {
        const material = this.passes.material;
        if (this.colouring?.on === "lines") {
            // Adjacent lines touch, so that the colours form a closed area.
            const apart = (this.spacing ??= this.meanSpacing()) * this.pixels();
            material.linewidth = Math.min(Math.max(1.3 * apart, WIDTH.pass), 3);
            return;
        }
        material.linewidth = WIDTH.pass;
        const share = this.colouring ? 0.6 : 1;
        material.opacity = this.centres.material.opacity = this.opacity() * share;
    }

    fill(array, { values, range, limit }) {
        const colour = new this.L.Color();
        const none = new this.L.Color().setStyle(this.surfaceColour);
        for (let k = 0; k < values.length; k++) {
            const value = values[k];
            if (Number.isNaN(value)) none.toArray(array, 3 * k);
            else linear(colour, value, range, limit).toArray(array, 3 * k);
        }
    }

    // Colours of the line segments: each end has the colour of the worst point up to it.
    lineColours({ values, range, limit, worse = (a, b) => a > b }) {
        const points = new Float32Array(3 * values.length);
        // A point without a value, such as the first of a pass, has the colour of the next.
        const filled = Float64Array.from(values);
        for (let k = filled.length - 2; k >= 0; k--) if (Number.isNaN(filled[k])) filled[k] = filled[k + 1];
        for (let k = 1; k < filled.length; k++) if (Number.isNaN(filled[k])) filled[k] = filled[k - 1];
        this.eachPiece(this.track.passes, (from, to) => {
            for (let point = from + 1; point < to; point++) {
                if (worse(filled[point], filled[to])) filled[to] = filled[point];
            }
        });
        this.fill(points, { values: filled, range, limit });
        const colours = [];
        this.eachPiece(this.track.passes, (from, to) => {
            for (const point of [from, to]) colours.push(points[3 * point], points[3 * point + 1], points[3 * point + 2]);
        });
        return colours.length ? new Float32Array(colours) : new Float32Array(6);
    }

    show({ surface, passes, centres, ball }) {
        this.faces.forEach((face) => (face.visible = surface));
        this.passes.visible = passes;
        this.centres.visible = centres === "all";
        this.showsOneCentre = centres !== "none";
        if (this.one) this.one[1].visible = this.showsOneCentre;
        this.tool.visible = ball;
        this.request();
    }

    // The tool at a tick, and its pass highlighted.
    moveTo(tick) {
        this.tick = tick;
        const at = this.track.at(tick);
        if (this.one?.pass !== at.index) {
            this.one?.forEach((line) => {
                line.removeFromParent();
                line.geometry.dispose();
                line.material.dispose();
            });
            const { cc, cl } = this.track;
            this.one = [cc, cl].map((places, k) => {
                const line = this.line(this.segments([at.pass], places, 3), WIDTH.one - k, { transparent: true });
                line.material.color.setStyle(variable(k === 0 ? "warm" : "violet"));
                line.renderOrder = 1;
                return line;
            });
            this.one.pass = at.index;
            this.one[1].visible = this.showsOneCentre ?? true;
            this.scene.add(...this.one);
        }
        this.ball.position.set(...at.cl);
        this.dots.cc.position.set(...at.cc);
        this.dots.cl.position.set(...at.cl);
        this.radius.geometry.setPositions([...at.cc, ...at.cl]);
        this.request();
        return at;
    }

    // Views from a direction, with the zoom fitted to the part.
    look(direction, everything = false) {
        const { Vector3 } = this.L;
        const toward = new Vector3(...direction).normalize();
        // For a view along z, a small tilt makes +y point up.
        if (Math.hypot(toward.x, toward.y) < 1e-6) toward.y = -1e-4;
        this.camera.position.copy(toward).multiplyScalar(4 * this.diagonal);
        this.camera.lookAt(0, 0, 0);
        this.camera.updateMatrixWorld();
        const inverse = this.camera.matrixWorldInverse.elements;
        const low = [Infinity, Infinity];
        const high = [-Infinity, -Infinity];
        const around = everything ? this.setting.everything() : [];
        for (const places of [this.surface.getAttribute("position").array, this.track.cl, around]) {
            for (let at = 0; at < places.length; at += 3) {
                for (let k = 0; k < 2; k++) {
                    const x = inverse[k] * places[at] + inverse[4 + k] * places[at + 1] + inverse[8 + k] * places[at + 2];
                    if (x < low[k]) low[k] = x;
                    if (x > high[k]) high[k] = x;
                }
            }
        }
        this.fit = low.map((a, k) => (high[k] - a) / 2 || 1);
        // Centre of the visible range.
        const middle = new Vector3((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, 0).applyQuaternion(this.camera.quaternion);
        this.controls.target.copy(middle);
        this.camera.position.add(middle);
        this.resize(true);
        this.controls.update();
    }

    // Applies a changed size of the canvas.
    resize(isNew = false) {
        const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
        if (!width || !height || (!isNew && this.width === width && this.height === height)) return;
        [this.width, this.height] = [width, height];
        this.renderer.setSize(width, height, false);
        // A margin for triad, scale bar and legend at the edges.
        const margin = Math.min(70, 0.08 * Math.min(width, height) + 6);
        this.scale = Math.min((width / 2 - margin) / this.fit[0], (height / 2 - margin) / this.fit[1]);
        Object.assign(this.camera, {
            left: -width / 2 / this.scale,
            right: width / 2 / this.scale,
            top: height / 2 / this.scale,
            bottom: -height / 2 / this.scale,
        });
        if (isNew) this.camera.zoom = 1;
        this.camera.updateProjectionMatrix();
        this.request();
    }

    // Rotates about the vertical and the horizontal axis of the view, rad.
    turn(about, over) {
        const { Vector3 } = this.L;
        const offset = this.camera.position.clone().sub(this.controls.target);
        const polar = Math.acos(offset.z / offset.length());
        offset.applyAxisAngle(new Vector3(0, 0, 1), about);
        const tilt = Math.min(Math.max(polar + over, 1e-3), Math.PI - 1e-3) - polar;
        const axis = new Vector3(-offset.y, offset.x, 0).normalize();
        offset.applyAxisAngle(axis, tilt);
        this.camera.position.copy(this.controls.target).add(offset);
        this.controls.update();
        this.request();
    }

    zoomBy(factor) {
        this.camera.zoom = Math.min(Math.max(this.camera.zoom * factor, this.controls.minZoom), this.controls.maxZoom);
        this.camera.updateProjectionMatrix();
        this.controls.update();
        this.request();
    }

    // Pixels per mm.
    pixels() {
        return this.scale * this.camera.zoom;
    }

    // Position of a point of the scene in pixels of the canvas.
    pixel(place) {
        const point = new this.L.Vector3(...place).project(this.camera);
        return [((point.x + 1) / 2) * this.width, ((1 - point.y) / 2) * this.height];
    }

    // Directions of the axes on the screen: right, up, towards the viewer.
    axes() {
        const turn = this.camera.quaternion.clone().invert();
        return [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) =>
            new this.L.Vector3(...axis).applyQuaternion(turn).toArray(),
        );
    }

    request() {
        this.requested ??= requestAnimationFrame(() => this.draw());
    }

    draw() {
        if (this.requested) cancelAnimationFrame(this.requested);
        this.requested = undefined;
        if (!this.width) return;
        this.refine();
        this.fade();
        const size = DOT / this.pixels();
        this.dots.cc.scale.setScalar(size);
        this.dots.cl.scale.setScalar(size);
        this.setting.draw(size);
        this.renderer.render(this.scene, this.camera);
        this.after.forEach((each) => each());
    }
}

// The colour of a value on a scale, interpolated as by the renderer.
function linear(colour, value, [low, high], limit) {
    const isOver = limit !== undefined && value > limit;
    const [r, g, b] = isOver ? OVER : colourAt(high > low ? (value - low) / (high - low) : 0.5);
    return colour.setRGB(r / 255, g / 255, b / 255, "srgb");
}
