// Bundles the libraries of the report page, with their licences, into one self-contained file.
import { readFile, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const FOLDER = "../../host-sim/src/report/viewer";
const licence = async (name) => {
    const { version } = JSON.parse(await readFile(`node_modules/${name}/package.json`, "utf8"));
    const text = (await readFile(`node_modules/${name}/LICENSE`, "utf8")).trim();
    return `${name} ${version}\n\n${text}`;
};
const notice = [await licence("three"), await licence("uplot")].join("\n\n----\n\n");
const { outputFiles } = await build({
    entryPoints: ["entry.js"],
    bundle: true,
    minify: true,
    write: false,
    format: "iife",
    globalName: "IsoLibraries",
    target: "es2020",
    legalComments: "none",
});
// In a page, the first end tag ends the script, even inside of a string.
const script = outputFiles[0].text.replaceAll("</script", "<\\/script");
await writeFile(`${FOLDER}/three-bundle.min.js`, `/*!\n${notice}\n*/\n${script}`);
await writeFile(`${FOLDER}/three-bundle.licence.txt`, `${notice}\n`);
const style = await readFile("node_modules/uplot/dist/uPlot.min.css", "utf8");
await writeFile(`${FOLDER}/uplot.min.css`, `${style.trim()}\n`);
console.log(`three-bundle.min.js: ${script.length} bytes`);
