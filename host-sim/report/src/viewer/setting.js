// What is drawn around the path: marks, links, stock, fixtures, home, safe height, travel, and the tool above the ball.

const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => [k & 1, (k >> 1) & 1, (k >> 2) & 1]);
// The edges of a box, by its corners, and its faces as triangles.
const BOX_EDGES = CORNERS.flatMap((a, i) => CORNERS.map((b, j) => [i, j, a.reduce((n, x, k) => n + (x !== b[k]), 0)]))
    .filter(([i, j, apart]) => i < j && apart === 1)
    .map(([i, j]) => [i, j]);
const BOX_FACES = [0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6];
const AROUND = 48; // sides of the tool

class Setting {
    constructor(view, setting) {
        this.view = view;
        this.setting = setting;
        this.L = view.L;
        this.colours = [];
        this.groups = { links: new this.L.Group(), setup: new this.L.Group(), machine: new this.L.Group(), marks: new this.L.Group() };
        view.scene.add(...Object.values(this.groups));
        this.addLinks();
        this.addSetup();
        this.addMachine();
        this.addMarks();
        this.addBody();
    }

    // A place of the job relative to the middle of the scene.
    local(place) {
        return place.map((x, k) => x - this.view.origin[k]);
    }

    line(positions, name, width, more = {}) {
        const line = this.view.line(new Float32Array(positions), width, { transparent: true, ...more });
        this.colours.push([line.material.color, name]);
        return line;
    }

    polyline(places) {
        const local = places.map((place) => this.local(place));
        return local.slice(1).flatMap((place, k) => [...local[k], ...place]);
    }

    addLinks() {
        const positions = this.setting.links.flatMap((link) => this.polyline(link));
        this.hasLinks = positions.length > 0;
        if (this.hasLinks) this.groups.links.add(this.line(positions, "green", 1.6));
    }

    edges([low, high]) {
        const corner = (k) => this.local(CORNERS[k].map((end, axis) => (end ? high : low)[axis]));
        return BOX_EDGES.flatMap(([a, b]) => [...corner(a), ...corner(b)]);
    }

    solid([low, high], name, opacity) {
        const { BufferAttribute, BufferGeometry, Mesh, MeshLambertMaterial } = this.L;
        const corner = (k) => this.local(CORNERS[k].map((end, axis) => (end ? high : low)[axis]));
        const geometry = new BufferGeometry();
        geometry.setAttribute("position", new BufferAttribute(new Float32Array(BOX_FACES.flatMap(corner)), 3));
        geometry.computeVertexNormals();
        const material = new MeshLambertMaterial({ transparent: true, opacity, depthWrite: false });
        this.colours.push([material.color, name]);
        const mesh = new Mesh(geometry, material);
        mesh.renderOrder = 2;
        return mesh;
    }

    addSetup() {
        const { stock, fixtures } = this.setting;
        if (stock) this.groups.setup.add(this.line(this.edges(stock), "axis", 1.4), this.solid(stock, "surface-back", 0.1));
        for (const { block } of fixtures) this.groups.setup.add(this.line(this.edges(block), "ink", 1.4), this.solid(block, "axis", 0.45));
        this.hasSetup = Boolean(stock) || fixtures.length > 0;
    }

    addMachine() {
        const { home, safe_z: safe, travel } = this.setting;
        if (travel) this.groups.machine.add(this.line(this.edges(travel), "blue", 1.2, { dashed: false }));
        if (safe !== null) {
            const { low, high } = this.view.extent;
            const own = this.view.origin.map((x, k) => x - this.view.middle[k]);
            const [x0, y0] = [low[0] + own[0], low[1] + own[1]];
            const [x1, y1] = [high[0] + own[0], high[1] + own[1]];
            const corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]].map(([x, y]) => [x, y, safe]);
            this.safeCorner = this.local(corners[1]);
            this.groups.machine.add(this.line(this.polyline(corners), "green", 1.2));
        }
        if (home) {
            const arm = 0.03 * this.view.diagonal;
            const [x, y, z] = this.local(home);
            this.home = [x, y, z];
            const cross = [[arm, 0, 0], [0, arm, 0], [0, 0, arm]].flatMap(([a, b, c]) => [x - a, y - b, z - c, x + a, y + b, z + c]);
            this.groups.machine.add(this.line(cross, "green", 2.4));
        }
        this.hasMachine = Boolean(home || travel || safe !== null);
    }

    addMarks() {
        const { Mesh, MeshBasicMaterial, SphereGeometry } = this.L;
        this.marks = this.setting.marks.map((mark) => {
            const material = new MeshBasicMaterial({ depthTest: false, transparent: true });
            this.colours.push([material.color, "bad"]);
            const dot = new Mesh(new SphereGeometry(1, 20, 14), material);
            dot.position.set(...this.local(mark.place));
            dot.renderOrder = 5;
            this.groups.marks.add(dot);
            return { ...mark, dot, at: this.local(mark.place) };
        });
    }

    // Neck, shank and holder turn about the axis above the ball's centre.
    addBody() {
        const { BufferAttribute, BufferGeometry, Mesh, MeshPhongMaterial } = this.L;
        const { tool } = this.setting;
        const positions = [];
        const place = ([radius, z], k) => {
            const angle = (2 * Math.PI * k) / AROUND;
            return [radius * Math.cos(angle), radius * Math.sin(angle), z];
        };
        for (let part = 1; part < tool.length; part++) {
            for (let k = 0; k < AROUND; k++) {
                const [a, b] = [place(tool[part - 1], k), place(tool[part - 1], k + 1)];
                const [c, d] = [place(tool[part], k + 1), place(tool[part], k)];
                positions.push(...a, ...b, ...c, ...a, ...c, ...d);
            }
        }
        const geometry = new BufferGeometry();
        geometry.setAttribute("position", new BufferAttribute(new Float32Array(positions), 3));
        geometry.computeVertexNormals();
        // DoubleSide is 2.
        const material = new MeshPhongMaterial({ transparent: true, opacity: 0.28, shininess: 30, depthWrite: false, side: 2 });
        this.colours.push([material.color, "axis"]);
        this.body = new Mesh(geometry, material);
        this.body.renderOrder = 3;
        this.view.ball.add(this.body);
    }

    dress() {
        for (const [colour, name] of this.colours) colour.setStyle(variable(name));
    }

    show({ links, setup, machine, marks, body }) {
        Object.assign(this.groups.links, { visible: links });
        Object.assign(this.groups.setup, { visible: setup });
        Object.assign(this.groups.machine, { visible: machine });
        Object.assign(this.groups.marks, { visible: marks });
        this.body.visible = body;
        this.view.request();
    }

    // Places that a view of everything contains.
    everything() {
        const { links, stock, fixtures, travel, home } = this.setting;
        const blocks = [stock, travel, ...fixtures.map(({ block }) => block)].filter(Boolean);
        const corners = blocks.flatMap(([low, high]) => CORNERS.map((corner) => corner.map((end, axis) => (end ? high : low)[axis])));
        return [...links.flat(), ...corners, ...(home ? [home] : [])].flatMap((place) => this.local(place));
    }

    // Before each drawing: dots keep their size.
    draw(size) {
        for (const { dot } of this.marks) dot.scale.setScalar(1.5 * size);
    }
}
