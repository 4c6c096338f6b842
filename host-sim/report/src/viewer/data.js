// Decodes the numbers of the page: 16-bit steps of a range, in base64, little-endian.

const NONE = 65535;

function wordsOf(text) {
    const raw = atob(text);
    const words = new Uint16Array(raw.length / 2);
    for (let k = 0; k < words.length; k++) {
        words[k] = raw.charCodeAt(2 * k) | (raw.charCodeAt(2 * k + 1) << 8);
    }
    return words;
}

// Values of a scale; NaN for missing ones.
function valuesOf(low, step, text) {
    return Float64Array.from(wordsOf(text), (word) => (word === NONE ? NaN : low + step * word));
}

const columnOf = (column) => valuesOf(column.low, column.step, column.data);

// Minimum and maximum of the values that are not NaN.
function extentOf(values) {
    let low = Infinity;
    let high = -Infinity;
    for (const value of values) {
        if (value < low) low = value;
        if (value > high) high = value;
    }
    return low <= high ? [low, high] : [0, 0];
}

// Positions relative to the middle of the box, mm, as a vertex buffer.
function placesOf(text, step, middle) {
    const words = wordsOf(text);
    const places = new Float32Array(words.length);
    for (let k = 0; k < words.length; k++) {
        places[k] = words[k] * step - middle[k % 3];
    }
    return places;
}

// The drawn passes: positions of contact and centre, and the worst of the samples that each point represents.
function trackOf(payload, middle) {
    const { track, box, period } = payload;
    let from = 0;
    const passes = track.passes.map(([pass, first, last, stride, count]) => {
        const begin = from;
        from += count;
        return { pass, first, last, stride, begin, count };
    });
    const values = Object.fromEntries(
        Object.entries(track.values).map(([name, column]) => [name, columnOf(column)]),
    );
    const ticks = new Float64Array(from);
    for (const { first, last, stride, begin, count } of passes) {
        for (let k = 0; k < count; k++) {
            ticks[begin + k] = Math.min(first + k * stride, last);
        }
    }
    return {
        passes,
        values,
        ticks,
        cc: placesOf(track.cc, box.step, middle),
        cl: placesOf(track.cl, box.step, middle),
        period,
        // The drawn pass at a tick, or the previous one.
        passAt(tick) {
            let low = 0;
            let high = passes.length - 1;
            while (low < high) {
                const between = (low + high + 1) >> 1;
                if (passes[between].first <= tick) low = between;
                else high = between - 1;
            }
            return low;
        },
        // Contact and centre at a tick, interpolated between the points of its pass.
        at(tick) {
            const index = this.passAt(tick);
            const pass = passes[index];
            const inPass = Math.max(0, Math.min(tick, pass.last) - pass.first);
            const near = Math.min(Math.floor(inPass / pass.stride), Math.max(pass.count - 2, 0));
            const here = pass.begin + near;
            const next = pass.begin + Math.min(near + 1, pass.count - 1);
            const span = ticks[next] - ticks[here];
            const share = span > 0 ? Math.min((pass.first + inPass - ticks[here]) / span, 1) : 0;
            const between = (places) =>
                [0, 1, 2].map((k) => places[3 * here + k] * (1 - share) + places[3 * next + k] * share);
            const point = share > 0 ? next : here;
            return { index, pass, point, cc: between(this.cc), cl: between(this.cl) };
        },
    };
}

// Spans of time with the minimum and maximum of each quantity.
function spansOf(json) {
    const decoded = new Map();
    return {
        first: json.first_tick,
        ticks: json.ticks,
        count: json.count,
        pass: json.pass,
        end: json.first_tick + json.count * json.ticks,
        channel(name) {
            if (!decoded.has(name)) {
                const { low, step, least, largest } = json.channels[name];
                decoded.set(name, [valuesOf(low, step, least), valuesOf(low, step, largest)]);
            }
            return decoded.get(name);
        },
    };
}

// The series of the run, and the columns of a chart between two ticks.
function seriesOf(json) {
    const whole = spansOf(json.whole);
    const details = json.details.map(spansOf);
    return {
        whole,
        details,
        // The finest spans that contain these ticks.
        source(from, to) {
            const fits = details.filter((spans) => spans.first <= from && to <= spans.end);
            return fits.reduce((best, spans) => (spans.ticks < best.ticks ? spans : best), whole);
        },
        // Minimum and maximum of quantities over columns between two ticks: times in ticks, and two rows per quantity.
        columns(names, from, to, most) {
            const spans = this.source(from, to);
            const first = Math.max(Math.floor((from - spans.first) / spans.ticks) - 1, 0);
            const last = Math.min(Math.ceil((to - spans.first) / spans.ticks) + 1, spans.count);
            const group = Math.max(Math.ceil((last - first) / most), 1);
            // Columns are aligned to multiples of the group, so that they do not change while the window moves.
            const begin = Math.floor(first / group) * group;
            const ends = [];
            for (let k = begin; k < last; k += group) ends.push([k, Math.min(k + group, spans.count)]);
            // The remainder at the end of the run joins the last column; alone it would appear as a drop.
            const [start, stop] = ends.at(-1) ?? [0, 0];
            if (ends.length > 1 && stop - start < group) {
                ends.pop();
                ends.at(-1)[1] = stop;
            }
            const times = ends.map(([k, end]) => spans.first + 0.5 * ((k + end) * spans.ticks - 1));
            const rows = names.flatMap((name) => {
                const [least, largest] = spans.channel(name);
                const low = [];
                const high = [];
                for (const [k, end] of ends) {
                    let [a, b] = [NaN, NaN];
                    for (let i = k; i < end; i++) {
                        if (!(least[i] >= a)) a = Number.isNaN(least[i]) ? a : least[i];
                        if (!(largest[i] <= b)) b = Number.isNaN(largest[i]) ? b : largest[i];
                    }
                    low.push(Number.isNaN(a) ? null : a);
                    high.push(Number.isNaN(b) ? null : b);
                }
                return [low, high];
            });
            return { times, rows, samples: group * spans.ticks, pass: spans.pass };
        },
    };
}
