//! The guide's way from a bare board to the first part (`docs/bring-up.md`), executed as it is written: every row of its tables on the flashed image, with a machine
//! around it, in real time.
//!
//! A row is "do | type | see". What is done comes to the machine by a comment of the row, which a reader does not see: `<!-- door -->` and `<!-- x-min=closed -->` are events of
//! the chip emulator. `<!-- until: running -->` asks for the status until it says so, `<!-- fails -->` is a command that is refused, `<!-- terminal -->` one that runs on a
//! terminal (by util-linux's `script`), `<!-- keys: right 1000 -->` holds a key there for 1000 ms. A command is in a code span and begins with `cargo sim`; anything else is
//! typed into the one that runs. Each code span of the last column has to be in the output. TOML blocks that begin with a file's name are that file.

use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use boards::SKR_PRO;

use super::emulated::{Emulated, tool, workspace};

/// Longest wait for expected output: on a busy computer the chip is slower than real time.
const PATIENCE: Duration = Duration::from_secs(240);

/// Interval of a terminal's key repeat.
const REPEAT: Duration = Duration::from_millis(33);

struct Row {
    comments: Vec<String>,
    typed: Option<String>,
    seen: Vec<String>,
}

fn between<'t>(text: &'t str, open: &str, close: &str) -> Vec<&'t str> {
    let mut found = Vec::new();
    let mut rest = text;
    while let Some((_, after)) = rest.split_once(open) {
        let Some((inside, after)) = after.split_once(close) else {
            break;
        };
        found.push(inside);
        rest = after;
    }
    found
}

fn rows(guide: &str) -> Vec<Row> {
    let way = between(guide, "<!-- begin way -->", "<!-- end way -->").concat();
    let cells =
        |line: &str| -> Vec<String> { line.trim_matches('|').split('|').map(str::to_owned).collect() };
    let owned = |texts: Vec<&str>| {
        texts
            .into_iter()
            .map(str::trim)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    way.lines()
        .filter(|line| line.starts_with('|'))
        .map(cells)
        .filter(|cells| cells.len() == 3 && !cells[0].starts_with("---") && cells[1].trim() != "type")
        .map(|cells| Row {
            comments: owned(between(&cells[0], "<!--", "-->")),
            typed: owned(between(&cells[1], "`", "`")).pop(),
            seen: owned(between(&cells[2], "`", "`")),
        })
        .collect()
}

/// The files of the guide, by their first line: `# machine.toml`.
fn write_files(guide: &str, folder: &Path) -> usize {
    let blocks = between(guide, "```toml\n", "```");
    let named = blocks.iter().filter_map(|block| {
        let name = block
            .lines()
            .next()?
            .strip_prefix("# ")?
            .split([':', ' '])
            .next()?;
        name.ends_with(".toml").then_some((name, block))
    });
    named
        .map(|(name, block)| std::fs::write(folder.join(name), block).unwrap())
        .count()
}

/// A command that runs, and what it has said.
struct Running {
    words: String,
    child: Child,
    input: Option<ChildStdin>,
    said: Arc<Mutex<Vec<u8>>>,
    fails: bool,
}

fn collect(mut from: impl Read + Send + 'static, said: &Arc<Mutex<Vec<u8>>>) {
    let said = Arc::clone(said);
    std::thread::spawn(move || {
        let mut bytes = [0; 4096];
        while let Ok(count @ 1..) = from.read(&mut bytes) {
            said.lock().unwrap().extend_from_slice(&bytes[..count]);
        }
    });
}

impl Running {
    fn begin(words: &str, port: &str, folder: &Path, row: &Row) -> Self {
        let has = |name: &str| row.comments.iter().any(|comment| comment == name);
        let arguments = words
            .strip_prefix("cargo sim ")
            .unwrap()
            .replace("/dev/ttyUSB0", port);
        let mut command = if has("terminal") {
            let mut command = Command::new("script");
            command.args(["-qec", &format!("{} {arguments}", tool().display()), "/dev/null"]);
            command
        } else {
            let mut command = Command::new(tool());
            command.args(arguments.split_whitespace());
            command
        };
        let mut child = command
            .current_dir(folder)
            .env("TERM", "xterm")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let said = Arc::default();
        collect(child.stdout.take().unwrap(), &said);
        collect(child.stderr.take().unwrap(), &said);
        Self {
            words: words.to_owned(),
            input: child.stdin.take(),
            child,
            said,
            fails: has("fails"),
        }
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.said.lock().unwrap()).into_owned()
    }

    fn send(&mut self, bytes: &[u8]) {
        let input = self.input.as_mut().unwrap();
        input.write_all(bytes).and_then(|()| input.flush()).unwrap();
    }

    /// Waits until every text has been said since `from`.
    fn wait_for(&self, seen: &[String], from: usize) {
        let begun = Instant::now();
        loop {
            let said = self.text();
            let new = said.get(from..).unwrap_or("");
            match seen.iter().find(|text| !new.contains(text.as_str())) {
                None => return,
                Some(missing) => assert!(
                    begun.elapsed() < PATIENCE,
                    "`{}` did not say `{missing}`:\n{said}",
                    self.words
                ),
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits for the end, which is a success unless the guide says otherwise.
    fn end(mut self) {
        let begun = Instant::now();
        let status = loop {
            match self.child.try_wait().unwrap() {
                Some(status) => break status,
                None => std::thread::sleep(Duration::from_millis(20)),
            }
            assert!(
                begun.elapsed() < PATIENCE,
                "`{}` does not end:\n{}",
                self.words,
                self.text()
            );
        };
        assert_eq!(
            status.success(),
            !self.fails,
            "`{}`:\n{}",
            self.words,
            self.text()
        );
    }
}

/// Holds a key down on the terminal: `right 1000`.
fn hold(running: &mut Running, key: &str) {
    let (name, ms) = key.split_once(' ').unwrap_or((key, "0"));
    let bytes: &[u8] = match name {
        "right" => b"\x1b[C",
        "up" => b"\x1b[A",
        "page-up" => b"\x1b[5~",
        "ctrl-c" => b"\x03",
        letter => letter.as_bytes(),
    };
    let until = Instant::now() + Duration::from_millis(ms.parse().unwrap());
    loop {
        running.send(bytes);
        if Instant::now() >= until {
            return;
        }
        std::thread::sleep(REPEAT);
    }
}

#[test]
fn the_guides_way_works_as_written() {
    let guide = std::fs::read_to_string(workspace().join("docs/bring-up.md")).unwrap();
    let machine = between(&guide, "<!-- machine: ", " -->")[0].to_owned();
    let folder = tempfile::tempdir().unwrap();
    assert!(write_files(&guide, folder.path()) >= 2);
    let rows = rows(&guide);
    assert!(rows.len() > 20, "{} rows", rows.len());
    let mut emulated = Emulated::with_machine(&SKR_PRO, &machine);
    let port = emulated.port();
    let mut running: Option<Running> = None;
    for row in &rows {
        let from = running.as_ref().map_or(0, |running| running.text().len());
        for comment in &row.comments {
            let (what, how) = comment.split_once(": ").unwrap_or((comment, ""));
            match what {
                "fails" | "terminal" => {}
                "keys" => hold(running.as_mut().unwrap(), how),
                "until" => {
                    let running = running.as_mut().unwrap();
                    let begun = Instant::now();
                    let from = running.text().len();
                    while !running.text()[from..].contains(how) {
                        assert!(begun.elapsed() < PATIENCE, "never {how}:\n{}", running.text());
                        running.send(b"status\n");
                        std::thread::sleep(Duration::from_millis(300));
                    }
                }
                event => {
                    emulated.happen(event);
                    std::thread::sleep(Duration::from_millis(100));
                }
            }
        }
        match row.typed.as_deref() {
            Some(words) if words.starts_with("cargo sim ") => {
                if let Some(before) = running.take() {
                    before.end();
                }
                println!("{words}");
                let begun = Running::begin(words, &port, folder.path(), row);
                begun.wait_for(&row.seen, 0);
                running = Some(begun);
            }
            Some(line) => {
                let running = running.as_mut().unwrap();
                running.send(format!("{line}\n").as_bytes());
                running.wait_for(&row.seen, from);
            }
            None => {
                if let Some(running) = &running {
                    running.wait_for(&row.seen, from);
                }
            }
        }
    }
    if let Some(last) = running {
        last.end();
    }
    let ended = emulated.end();
    ended.no_complaint();
    assert_eq!(ended.number("bytes_lost"), 0);
    assert_eq!(ended.report["spindle_duty"].as_f64(), Some(0.0));
}
