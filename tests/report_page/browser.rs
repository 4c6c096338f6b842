//! A headless Chromium, controlled by the DevTools protocol over two pipes, without a port or a driver program.
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Names of the program on common systems, as in `scripts/setup.sh`.
const NAMES: [&str; 4] = [
    "chromium",
    "google-chrome",
    "google-chrome-stable",
    "chromium-browser",
];
/// Timeout of an answer: the first drawing in software takes seconds, and more on a busy machine.
const PATIENCE: Duration = Duration::from_secs(600);

/// The browser's program.
fn program() -> PathBuf {
    if let Some(named) = std::env::var_os("CHROMIUM") {
        return named.into();
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<_> = std::env::split_paths(&path).collect();
    NAMES
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)))
        .find(|file| file.is_file())
        .expect(
            "no Chromium to open the report with: install the package `chromium` (Debian) or Google Chrome (Ubuntu, where the \
             package is a snap), or name the program in the variable CHROMIUM",
        )
}

/// Permits one browser at a time, because two would compete for the processor.
static ONE: Mutex<()> = Mutex::new(());

/// A browser with one page.
pub(crate) struct Browser {
    child: Child,
    to: Option<ChildStdin>,
    from: Receiver<Value>,
    session: Option<String>,
    last: u64,
    /// Errors, warnings and exceptions of the page.
    pub(crate) complaints: Vec<String>,
    /// Addresses that were requested.
    pub(crate) requests: Vec<String>,
    profile: tempfile::TempDir,
    _one: MutexGuard<'static, ()>,
}

impl Browser {
    /// Starts a browser with a page of this size in pixels, and with `flags` in addition to the common ones.
    pub(crate) fn start(size: [u32; 2], theme: &str, flags: &[&str]) -> Self {
        let one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        let profile = tempfile::tempdir().unwrap();
        let log = std::fs::File::create(profile.path().join("log")).unwrap();
        // The protocol uses descriptors 3 and 4; the shell connects them to the pipes.
        let mut child = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null"])
            .arg(program())
            .args([
                "--headless=new",
                "--remote-debugging-pipe",
                "--no-first-run",
                "--hide-scrollbars",
            ])
            // The browser opens only the report, and a container does not grant the rights that the sandbox needs.
            .args(["--no-sandbox", "--disable-dev-shm-usage"])
            .args(["--disable-background-networking", "--disable-component-update"])
            .arg(format!(
                "--user-data-dir={}",
                profile.path().join("profile").display()
            ))
            .args(flags)
            .arg("about:blank")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()
            .unwrap();
        let (send, from) = channel();
        let mut pipe = BufReader::new(child.stdout.take().unwrap());
        std::thread::spawn(move || {
            let mut message = Vec::new();
            while pipe.read_until(0, &mut message).is_ok_and(|length| length > 0) {
                message.pop();
                if send
                    .send(serde_json::from_slice(&message).unwrap_or(Value::Null))
                    .is_err()
                {
                    break;
                }
                message.clear();
            }
        });
        let mut browser = Self {
            to: child.stdin.take(),
            child,
            from,
            session: None,
            last: 0,
            complaints: Vec::new(),
            requests: Vec::new(),
            profile,
            _one: one,
        };
        browser.attach(size, theme);
        browser
    }

    fn attach(&mut self, [width, height]: [u32; 2], theme: &str) {
        let target = self.call("Target.createTarget", json!({ "url": "about:blank" }));
        let parameters = json!({ "targetId": target["targetId"], "flatten": true });
        let session = self.call("Target.attachToTarget", parameters);
        self.session = session["sessionId"].as_str().map(str::to_owned);
        for domain in ["Runtime", "Log", "Network", "Page"] {
            self.call(&format!("{domain}.enable"), json!({}));
        }
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", metrics);
        let features = json!({ "features": [{ "name": "prefers-color-scheme", "value": theme }] });
        self.call("Emulation.setEmulatedMedia", features);
    }

    /// The browser's standard error, for failure messages.
    fn log(&self) -> String {
        std::fs::read_to_string(self.profile.path().join("log")).unwrap_or_default()
    }

    /// Calls a method of the protocol and returns its result.
    pub(crate) fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.last += 1;
        let mut message = json!({ "id": self.last, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        let mut bytes = message.to_string().into_bytes();
        bytes.push(0);
        let sent = self.to.as_mut().unwrap().write_all(&bytes);
        assert!(sent.is_ok(), "the browser ended: {}", self.log());
        let end = Instant::now() + PATIENCE;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let Ok(answer) = self.from.recv_timeout(left) else {
                panic!("no answer to {method}; the browser wrote: {}", self.log());
            };
            if answer["id"] == self.last {
                assert!(answer.get("error").is_none(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
            self.hear(&answer);
        }
    }

    /// Records complaints and requests from an event.
    fn hear(&mut self, event: &Value) {
        let parameters = &event["params"];
        match event["method"].as_str() {
            Some("Runtime.consoleAPICalled") if parameters["type"] != "info" => {
                self.complaints.push(format!("console: {}", parameters["args"]));
            }
            Some("Runtime.exceptionThrown") => {
                self.complaints
                    .push(format!("exception: {}", parameters["exceptionDetails"]));
            }
            Some("Log.entryAdded") if !is_of_the_machine(&parameters["entry"]) => {
                self.complaints.push(format!("log: {}", parameters["entry"]));
            }
            Some("Network.requestWillBeSent") => {
                let url = parameters["request"]["url"].as_str().unwrap_or("?");
                self.requests.push(url.to_owned());
            }
            _ => {}
        }
    }

    /// Opens a file, and waits until the report's scripts are ready.
    pub(crate) fn open(&mut self, page: &Path) {
        let url = format!("file://{}", page.display());
        self.call("Page.navigate", json!({ "url": url }));
        let ready = "new Promise((done) => { const look = () => window.isofeedReport?.ready ? done(true) : setTimeout(look, 20); look(); })";
        // After an exception during loading, the page would never become ready.
        let end = Instant::now() + PATIENCE;
        while self.value("Boolean(window.isofeedReport?.ready)") != json!(true) {
            assert!(self.complaints.is_empty(), "{:?}", self.complaints);
            assert!(Instant::now() < end, "the page is not ready; {}", self.log());
            std::thread::sleep(Duration::from_millis(50));
        }
        self.value(ready);
    }

    /// Evaluates an expression; a promise is awaited.
    pub(crate) fn value(&mut self, expression: &str) -> Value {
        let parameters = json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let answer = self.call("Runtime.evaluate", parameters);
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {answer}");
        answer["result"]["value"].clone()
    }

    /// Evaluates an expression to a number.
    pub(crate) fn number(&mut self, expression: &str) -> f64 {
        let value = self.value(expression);
        value.as_f64().unwrap_or_else(|| panic!("{expression}: {value}"))
    }

    /// Evaluates an expression to a string.
    pub(crate) fn text(&mut self, expression: &str) -> String {
        let value = self.value(expression);
        value
            .as_str()
            .unwrap_or_else(|| panic!("{expression}: {value}"))
            .to_owned()
    }

    /// Drags with the left button between two points of an element, each given as fractions of its size.
    pub(crate) fn drag(&mut self, element: &str, from: [f64; 2], to: [f64; 2]) {
        let [from, to] = [self.place(element, from), self.place(element, to)];
        self.mouse("mouseMoved", from, 0);
        self.mouse("mousePressed", from, 1);
        for step in 1..=5 {
            let share = f64::from(step) / 5.0;
            self.mouse(
                "mouseMoved",
                [0, 1].map(|k| from[k] + share * (to[k] - from[k])),
                1,
            );
        }
        self.mouse("mouseReleased", to, 0);
    }

    /// Moves the mouse to a point of an element, given as fractions of its size.
    pub(crate) fn point(&mut self, element: &str, at: [f64; 2]) {
        let at = self.place(element, at);
        self.mouse("mouseMoved", at, 0);
    }

    /// Turns the mouse wheel over the middle of an element.
    pub(crate) fn wheel(&mut self, element: &str, by: f64) {
        let [x, y] = self.place(element, [0.5, 0.5]);
        let event = json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": by });
        self.call("Input.dispatchMouseEvent", event);
    }

    /// Presses a key.
    pub(crate) fn key(&mut self, key: &str) {
        for event in ["rawKeyDown", "keyUp"] {
            self.call(
                "Input.dispatchKeyEvent",
                json!({ "type": event, "key": key, "code": key }),
            );
        }
    }

    fn mouse(&mut self, event: &str, [x, y]: [f64; 2], buttons: u32) {
        let button = if event == "mouseMoved" { "none" } else { "left" };
        let event =
            json!({ "type": event, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1 });
        self.call("Input.dispatchMouseEvent", event);
    }

    /// Scrolls an element into view. Returns the window coordinates of a point of it, given as fractions of its size.
    fn place(&mut self, element: &str, share: [f64; 2]) -> [f64; 2] {
        let element = format!("document.querySelector({})", json!(element));
        let value = self.value(&format!(
            "(() => {{ {element}.scrollIntoView({{ block: 'center', behavior: 'instant' }}); const b = {element}.getBoundingClientRect(); \
             return [b.x, b.y, b.width, b.height]; }})()"
        ));
        let [x, y, width, height] = [0, 1, 2, 3].map(|k| value[k].as_f64().unwrap());
        [x + share[0] * width, y + share[1] * height]
    }
}

/// Whether a log entry concerns the machine and not the page: when pixels are read back, Chromium warns that drawing in software is
/// slow.
fn is_of_the_machine(entry: &Value) -> bool {
    entry["source"] == "rendering" && entry["level"] != "error"
}

impl Drop for Browser {
    fn drop(&mut self) {
        // The browser ends when its pipe closes; after 5 s it is killed.
        self.to = None;
        for _ in 0..100 {
            if matches!(self.child.try_wait(), Ok(Some(_))) {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
