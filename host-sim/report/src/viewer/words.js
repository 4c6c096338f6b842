// Shared by view and charts: number formats, ticks of scales, colours.

// A number with the given significant digits, integer part in groups of three digits.
function shown(value, digits = 4) {
    if (!Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-3 || size >= 1e7)) {
        const [mantissa, exponent] = value.toExponential(Math.max(digits - 2, 0)).split("e");
        return `${mantissa.replace("-", "−")}·10${superscript(Number(exponent))}`;
    }
    const decimals = size === 0 ? 0 : Math.max(digits - 1 - Math.floor(Math.log10(size)), 0);
    return fixed(value, decimals);
}

// A number with the given number of decimals.
function fixed(value, decimals) {
    const [whole, rest] = Math.abs(value).toFixed(decimals).split(".");
    const grouped = whole.replace(/\B(?=(\d{3})+$)/g, "\u202f");
    const isZero = Number(Math.abs(value).toFixed(decimals)) === 0;
    return (value < 0 && !isZero ? "−" : "") + grouped + (rest ? `.${rest}` : "");
}

const superscript = (number) =>
    [...String(number)].map((c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(c)])).join("");

// The step of 1, 2 or 5 times a power of ten that is not below a value.
function roundAbove(value) {
    const power = 10 ** Math.floor(Math.log10(value));
    return [1, 2, 5, 10].map((k) => k * power).find((round) => round >= value * (1 - 1e-9));
}

// About `count` round values within a range, with enough decimals to distinguish them.
function ticksIn(low, high, count) {
    const step = roundAbove((high - low) / count);
    const decimals = Math.max(-Math.floor(Math.log10(step) + 1e-9), 0);
    const ticks = [];
    for (let k = Math.ceil(low / step - 1e-6); k * step <= high + step * 1e-6; k++) {
        ticks.push(k * step);
    }
    return { ticks, step, label: (value) => (step < 1e-4 || step >= 1e6 ? shown(value, 2) : fixed(value, decimals)) };
}

// A range that ends at round values.
function roundRange(low, high) {
    const step = roundAbove((high - low || Math.abs(high) || 1) / 5);
    return [Math.floor(low / step + 1e-9) * step, Math.ceil(high / step - 1e-9) * step];
}

// The colour map viridis (S. van der Walt, N. Smith; CC0) at equal distances: perceptually uniform, also with red-green
// colour blindness.
const VIRIDIS = [
    [68, 1, 84], [72, 40, 120], [62, 73, 137], [49, 104, 142], [38, 130, 142],
    [31, 158, 137], [53, 183, 121], [110, 206, 88], [181, 222, 43], [253, 231, 37],
];
// Colour of exceeded limits; not in the map.
const OVER = [230, 0, 90];

// The colour at a share of the map, 0 to 1; for NaN, none.
function colourAt(share) {
    const place = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1);
    const index = Math.min(Math.floor(place), VIRIDIS.length - 2);
    const [from, to] = [VIRIDIS[index], VIRIDIS[index + 1]];
    return from.map((c, k) => c + (to[k] - c) * (place - index));
}

const cssColour = (rgb) => `rgb(${rgb.map(Math.round).join(" ")})`;
const variable = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const byId = (id) => document.getElementById(id);

// An element with attributes, text and children.
function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
        if (value === true) made.setAttribute(key, "");
        else if (value !== false && value !== undefined) made.setAttribute(key, value);
    }
    made.append(...children);
    return made;
}
