//! A headless Chromium, driven over its DevTools protocol on two pipes: no port, no other program between.
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Names under which systems install it, as in `scripts/setup.sh`.
const NAMES: [&str; 4] = [
    "chromium",
    "google-chrome",
    "google-chrome-stable",
    "chromium-browser",
];
/// The longest that an answer may take: the first drawing without a graphics card takes seconds, on a busy machine more.
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

/// One browser at a time: two would share the cores of one.
static ONE: Mutex<()> = Mutex::new(());

/// A browser with one page.
pub(crate) struct Browser {
    child: Child,
    to: Option<ChildStdin>,
    from: Receiver<Value>,
    session: Option<String>,
    last: u64,
    /// Everything that the page did wrong or asked for, in words.
    pub(crate) complaints: Vec<String>,
    /// Addresses that were requested.
    pub(crate) requests: Vec<String>,
    profile: tempfile::TempDir,
    _one: MutexGuard<'static, ()>,
}

impl Browser {
    /// Starts one, with a page of this size in pixels; `flags` besides the usual.
    pub(crate) fn start(size: [u32; 2], theme: &str, flags: &[&str]) -> Self {
        let one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        let profile = tempfile::tempdir().unwrap();
        let log = std::fs::File::create(profile.path().join("log")).unwrap();
        // The protocol is on descriptors 3 and 4; the shell gives them our pipes.
        let mut child = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null"])
            .arg(program())
            .args([
                "--headless=new",
                "--remote-debugging-pipe",
                "--no-first-run",
                "--hide-scrollbars",
            ])
            // The only page is ours and the sandbox needs rights that a container does not give.
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

    /// What the browser wrote, for a failure's message.
    fn log(&self) -> String {
        std::fs::read_to_string(self.profile.path().join("log")).unwrap_or_default()
    }

    /// A call of the protocol, and its result.
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

    /// Keeps what an event says against the page.
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

    /// Opens a file, and waits until the report's scripts have done their work.
    pub(crate) fn open(&mut self, page: &Path) {
        let url = format!("file://{}", page.display());
        self.call("Page.navigate", json!({ "url": url }));
        let ready = "new Promise((done) => { const look = () => window.isofeedReport?.ready ? done(true) : setTimeout(look, 20); look(); })";
        // An exception while loading would let this wait in vain.
        let end = Instant::now() + PATIENCE;
        while self.value("Boolean(window.isofeedReport?.ready)") != json!(true) {
            assert!(self.complaints.is_empty(), "{:?}", self.complaints);
            assert!(Instant::now() < end, "the page is not ready; {}", self.log());
            std::thread::sleep(Duration::from_millis(50));
        }
        self.value(ready);
    }

    /// The value of an expression, or of what it promises.
    pub(crate) fn value(&mut self, expression: &str) -> Value {
        let parameters = json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let answer = self.call("Runtime.evaluate", parameters);
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {answer}");
        answer["result"]["value"].clone()
    }

    /// A number.
    pub(crate) fn number(&mut self, expression: &str) -> f64 {
        let value = self.value(expression);
        value.as_f64().unwrap_or_else(|| panic!("{expression}: {value}"))
    }

    /// A text.
    pub(crate) fn text(&mut self, expression: &str) -> String {
        let value = self.value(expression);
        value
            .as_str()
            .unwrap_or_else(|| panic!("{expression}: {value}"))
            .to_owned()
    }

    /// Moves the mouse from a place of an element to another, both as shares of its size, with the left button pressed.
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

    /// Moves the mouse onto a place of an element.
    pub(crate) fn point(&mut self, element: &str, at: [f64; 2]) {
        let at = self.place(element, at);
        self.mouse("mouseMoved", at, 0);
    }

    /// Turns the wheel over the middle of an element.
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

    /// A place of an element in the window, scrolled into sight.
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

/// Whether an entry of the log is about the machine and not the page: drawing without a graphics card is slow, which
/// Chromium remarks when pixels are read back.
fn is_of_the_machine(entry: &Value) -> bool {
    entry["source"] == "rendering" && entry["level"] != "error"
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It ends with its pipe; a while later at the latest.
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
