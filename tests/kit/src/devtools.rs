//! A browser that a test drives as a person does, over the DevTools protocol: keys, mouse, what can be
//! seen and what a screen reader is told.

use std::fs::{self, File};
use std::io::ErrorKind;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

/// A browser that does not do something by then hangs.
const PATIENCE: Duration = Duration::from_mins(1);
const PAUSE: Duration = Duration::from_millis(20);

/// The next message of a socket. A read with a time limit is interrupted where the machine stops processes for a while,
/// and begun again.
pub(crate) fn read(socket: &mut WebSocket<TcpStream>) -> tungstenite::Result<Message> {
    loop {
        match socket.read() {
            Err(tungstenite::Error::Io(error)) if error.kind() == ErrorKind::Interrupted => {}
            other => return other,
        }
    }
}

/// A page in a browser of its own, both of which end with this.
pub struct Page {
    browser: Child,
    socket: WebSocket<TcpStream>,
    session: String,
    folder: PathBuf,
    last: u64,
    /// Errors of the page's scripts, and what its policy forbade.
    pub errors: Vec<String>,
    /// Questions of the browser in the name of the page, by their kinds; each was answered with yes.
    pub questions: Vec<String>,
}

impl Drop for Page {
    fn drop(&mut self) {
        let _ = self.browser.kill();
        let _ = self.browser.wait();
    }
}

impl Page {
    /// Opens an address. `folder` is for the browser's own files, and downloads.
    pub fn open(browser: &str, folder: &Path, address: &str, [width, height]: [u32; 2]) -> Self {
        let profile = folder.join("profile");
        let child = Command::new(browser)
            .args(["--headless", "--no-sandbox", "--disable-gpu"])
            // WebGL by the processor, for pages that ask for it.
            .arg("--enable-unsafe-swiftshader")
            .args(["--disable-dev-shm-usage", "--no-first-run"])
            .arg("--remote-debugging-port=0")
            .arg(format!("--window-size={width},{height}"))
            .arg(format!("--user-data-dir={}", profile.display()))
            .arg("about:blank")
            .stdout(Stdio::null())
            .stderr(File::create(folder.join("browser.log")).unwrap())
            .spawn()
            .unwrap();
        // The browser says its port in a file: the number, and the path of its socket.
        let said = patiently("the browser to listen", || {
            let said = fs::read_to_string(profile.join("DevToolsActivePort")).ok()?;
            let (port, path) = said.split_once('\n')?;
            Some((port.parse::<u16>().ok()?, path.trim().to_owned()))
        });
        let (port, path) = said;
        let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) =
            tungstenite::client(format!("ws://127.0.0.1:{port}{path}"), stream).unwrap();
        let mut page = Self {
            browser: child,
            socket,
            session: String::new(),
            folder: folder.to_owned(),
            last: 0,
            errors: Vec::new(),
            questions: Vec::new(),
        };
        let target = page.call("Target.createTarget", &json!({"url": "about:blank"}));
        let target = json!({"targetId": target["targetId"], "flatten": true});
        let attached = page.call("Target.attachToTarget", &target);
        attached["sessionId"]
            .as_str()
            .unwrap()
            .clone_into(&mut page.session);
        for domain in ["Page", "Runtime", "Log", "DOM", "Accessibility"] {
            page.call(&format!("{domain}.enable"), &json!({}));
        }
        let size =
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        page.call("Emulation.setDeviceMetricsOverride", &size);
        let downloads = json!({"behavior": "allow", "downloadPath": folder.display().to_string()});
        page.call("Browser.setDownloadBehavior", &downloads);
        page.go(address);
        page
    }

    /// Goes to an address.
    pub fn go(&mut self, address: &str) {
        let went = self.call("Page.navigate", &json!({"url": address}));
        assert!(went["errorText"].is_null(), "{address}: {went}");
    }

    /// Loads the page again.
    pub fn reload(&mut self) {
        // So that nobody takes the page that goes for the one that comes.
        self.eval("document.documentElement.removeAttribute('data-ready')");
        self.call("Page.reload", &json!({}));
    }

    /// Calls a method of the protocol.
    #[track_caller]
    pub fn call(&mut self, method: &str, parameters: &Value) -> Value {
        let answer = self.ask(method, parameters);
        answer.unwrap_or_else(|error| panic!("{method}: {error}"))
    }

    /// Calls a method of the protocol; the error where it is refused.
    fn ask(&mut self, method: &str, parameters: &Value) -> Result<Value, Value> {
        self.last += 1;
        let id = self.last;
        let mut message = json!({"id": id, "method": method, "params": parameters});
        if !self.session.is_empty() {
            message["sessionId"] = self.session.as_str().into();
        }
        self.socket.send(message.to_string().into()).unwrap();
        loop {
            let Message::Text(text) = read(&mut self.socket).unwrap() else {
                continue;
            };
            let mut said: Value = serde_json::from_str(&text).unwrap();
            if said["id"] == id {
                return match said["error"].take() {
                    Value::Null => Ok(said["result"].take()),
                    error => Err(error),
                };
            }
            self.hear(&said);
        }
    }

    fn hear(&mut self, said: &Value) {
        let parameters = &said["params"];
        match said["method"].as_str() {
            Some("Runtime.exceptionThrown") => {
                let details = &parameters["exceptionDetails"];
                let text = details["exception"]["description"].as_str();
                let text = text.or(details["text"].as_str()).unwrap_or_default();
                self.errors.push(text.to_owned());
            }
            Some("Log.entryAdded") if parameters["entry"]["source"] == "security" => {
                self.errors.push(parameters["entry"]["text"].to_string());
            }
            Some("Page.javascriptDialogOpening") => {
                let kind = parameters["type"].as_str().unwrap_or_default();
                self.questions.push(kind.to_owned());
                // The answer is nobody's: whoever listens passes it over.
                self.last += 1;
                let yes = json!({"id": self.last, "sessionId": self.session,
                    "method": "Page.handleJavaScriptDialog", "params": {"accept": true}});
                self.socket.send(yes.to_string().into()).unwrap();
            }
            _ => {}
        }
    }

    /// The value of an expression, a promise's once it is kept.
    #[track_caller]
    pub fn eval(&mut self, expression: &str) -> Value {
        let asked = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let mut answer = self.call("Runtime.evaluate", &asked);
        let thrown = &answer["exceptionDetails"];
        assert!(thrown.is_null(), "{expression}: {thrown}");
        answer["result"]["value"].take()
    }

    /// Waits until an expression is true.
    #[track_caller]
    pub fn until(&mut self, expression: &str) {
        // A page that is just being loaded has no names yet, and one that goes has no answer.
        let asked = format!(
            "(() => {{ try {{ return Boolean({expression}); }} catch {{ return false; }} }})()"
        );
        let asked = json!({"expression": asked, "returnByValue": true});
        let end = Instant::now() + PATIENCE;
        while !self
            .ask("Runtime.evaluate", &asked)
            .is_ok_and(|answer| answer["result"]["value"] == true)
        {
            assert!(
                Instant::now() < end,
                "never true: {expression}\n{:?}",
                self.errors
            );
            sleep(PAUSE);
        }
    }

    /// Presses a key, with the modifiers before it: `Ctrl+Shift+z`, `Enter`, `a`.
    pub fn key(&mut self, name: &str) {
        let mut parts: Vec<&str> = name.split('+').collect();
        let mut key = parts.pop().unwrap_or_default();
        if key.is_empty() {
            key = "+";
            parts.retain(|part| !part.is_empty());
        }
        let modifiers: u32 = parts
            .iter()
            .map(|part| match *part {
                "Alt" => 1,
                "Ctrl" => 2,
                "Shift" => 8,
                other => panic!("no modifier: {other}"),
            })
            .sum();
        let (key, text, code) = match key {
            "Enter" => ("Enter", Some("\r"), 13),
            "Space" => (" ", Some(" "), 32),
            "Tab" => ("Tab", None, 9),
            "Escape" => ("Escape", None, 27),
            "Backspace" => ("Backspace", None, 8),
            "Delete" => ("Delete", None, 46),
            "Home" => ("Home", None, 36),
            "End" => ("End", None, 35),
            "ArrowLeft" => ("ArrowLeft", None, 37),
            "ArrowUp" => ("ArrowUp", None, 38),
            "ArrowRight" => ("ArrowRight", None, 39),
            "ArrowDown" => ("ArrowDown", None, 40),
            letter => {
                let upper = letter.to_ascii_uppercase();
                (letter, Some(letter), u32::from(upper.as_bytes()[0]))
            }
        };
        let mut down = json!({"key": key, "modifiers": modifiers, "windowsVirtualKeyCode": code});
        // A key with Control types nothing.
        let text = text.filter(|_| !parts.iter().any(|part| matches!(*part, "Alt" | "Ctrl")));
        down["type"] = if text.is_some() {
            "keyDown"
        } else {
            "rawKeyDown"
        }
        .into();
        if let Some(text) = text {
            down["text"] = text.into();
        }
        self.call("Input.dispatchKeyEvent", &down);
        down["type"] = "keyUp".into();
        self.call("Input.dispatchKeyEvent", &down);
    }

    /// Presses keys one after the other.
    pub fn keys(&mut self, names: &[&str]) {
        for name in names {
            self.key(name);
        }
    }

    /// Presses Tab until an element of a selector has the focus.
    #[track_caller]
    pub fn tab_to(&mut self, selector: &str) {
        let there = format!("document.activeElement?.matches({selector:?})");
        for _ in 0..200 {
            if self.eval(&there) == true {
                return;
            }
            self.key("Tab");
        }
        panic!("Tab leads to no {selector}");
    }

    /// Drops files on a point of the window, as the page is told of it: a browser without a window takes none
    /// from elsewhere.
    pub fn drop_files(&mut self, [x, y]: [f64; 2], files: &[PathBuf]) {
        let named = files.iter().map(|file| {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            json!([name, fs::read(file).unwrap()])
        });
        let named: Vec<Value> = named.collect();
        self.eval(&format!(
            "(() => {{ const dataTransfer = new DataTransfer(); \
             for (const [name, bytes] of {}) dataTransfer.items.add(new File([Uint8Array.from(bytes)], name)); \
             for (const kind of ['dragenter', 'dragover', 'drop']) document.elementFromPoint({x}, {y}) \
             .dispatchEvent(new DragEvent(kind, {{ bubbles: true, cancelable: true, dataTransfer }})); }})()",
            json!(named)
        ));
    }

    /// Prefers dark colours, or light ones.
    pub fn prefer(&mut self, scheme: &str) {
        let features = json!([{"name": "prefers-color-scheme", "value": scheme}]);
        self.call("Emulation.setEmulatedMedia", &json!({"features": features}));
    }

    /// Types a text where the focus is.
    pub fn write(&mut self, text: &str) {
        self.call("Input.insertText", &json!({"text": text}));
    }

    fn mouse(&mut self, kind: &str, [x, y]: [f64; 2], buttons: u32) {
        let button = if kind == "mouseMoved" && buttons == 0 {
            "none"
        } else {
            "left"
        };
        let event = json!({"type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1});
        self.call("Input.dispatchMouseEvent", &event);
    }

    /// Clicks a point of the window, in pixels.
    pub fn click_at(&mut self, at: [f64; 2]) {
        self.mouse("mouseMoved", at, 0);
        self.mouse("mousePressed", at, 1);
        self.mouse("mouseReleased", at, 0);
    }

    /// Clicks the middle of the element of a selector, which is scrolled to.
    #[track_caller]
    pub fn click(&mut self, selector: &str) {
        let at = self.eval(&format!(
            "(() => {{ const node = document.querySelector({selector:?}); if (!node) return null; \
             node.scrollIntoView({{ block: 'center' }}); const box = node.getBoundingClientRect(); \
             return [box.left + box.width / 2, box.top + box.height / 2]; }})()"
        ));
        let [Some(x), Some(y)] = [at[0].as_f64(), at[1].as_f64()] else {
            panic!("there is no {selector}");
        };
        self.click_at([x, y]);
    }

    /// Drags from one point of the window to another.
    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        self.mouse("mouseMoved", from, 0);
        self.mouse("mousePressed", from, 1);
        for part in [0.3, 0.7, 1.0] {
            let at = [0, 1].map(|axis| from[axis] + part * (to[axis] - from[axis]));
            self.mouse("mouseMoved", at, 1);
        }
        self.mouse("mouseReleased", to, 0);
    }

    /// Gives files to an input for files.
    pub fn choose(&mut self, selector: &str, files: &[PathBuf]) {
        let root = self.call("DOM.getDocument", &json!({}));
        let wanted = json!({"nodeId": root["root"]["nodeId"], "selector": selector});
        let found = self.call("DOM.querySelector", &wanted);
        let files: Vec<String> = files
            .iter()
            .map(|file| file.display().to_string())
            .collect();
        let given = json!({"nodeId": found["nodeId"], "files": files});
        self.call("DOM.setFileInputFiles", &given);
    }

    /// A file that the page has given to the user, once it is whole.
    #[track_caller]
    pub fn download(&mut self, is_it: impl Fn(&str) -> bool) -> PathBuf {
        let folder = self.folder.clone();
        patiently("a file", || {
            let entries = fs::read_dir(&folder).ok()?.flatten();
            let mut files =
                entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()));
            // A file that is being written has another name.
            files
                .find_map(|entry| is_it(&entry.file_name().to_string_lossy()).then(|| entry.path()))
        })
    }

    /// Role and name of everything that can have the focus, as screen readers are told.
    pub fn focusable(&mut self) -> Vec<(String, String)> {
        let tree = self.call("Accessibility.getFullAXTree", &json!({}));
        let text = |value: &Value| value["value"].as_str().unwrap_or_default().to_owned();
        let nodes = tree["nodes"].as_array().cloned().unwrap_or_default();
        let nodes = nodes.iter().filter(|node| node["ignored"] != true);
        let nodes = nodes.filter(|node| {
            let properties = node["properties"].as_array();
            let mut properties = properties.into_iter().flatten();
            properties.any(|p| p["name"] == "focusable" && p["value"]["value"] == true)
        });
        nodes
            .map(|node| (text(&node["role"]), text(&node["name"])))
            .filter(|(role, _)| role != "RootWebArea")
            .collect()
    }

    /// The window as a picture, PNG as base64.
    pub fn picture(&mut self) -> String {
        let taken = self.call("Page.captureScreenshot", &json!({"format": "png"}));
        taken["data"].as_str().unwrap_or_default().to_owned()
    }
}

/// Asks again until there is an answer.
#[track_caller]
fn patiently<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + PATIENCE;
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        assert!(Instant::now() < end, "waited in vain for {what}");
        sleep(PAUSE);
    }
}
