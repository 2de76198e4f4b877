//! Pages in a real browser, for the tests of this crate and of others.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A browser, or why there is none.
pub fn chromium() -> Option<&'static str> {
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|name| {
            let version = Command::new(name).arg("--version").output();
            version.is_ok_and(|output| output.status.success())
        })
}

/// Ends a browser, whatever happens.
struct Browser(Child);

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Opens a page and waits for what the self-test says on the console.
pub fn selftest(browser: &str, folder: &Path, page: &Path, size: &str) -> String {
    let log = folder.join("browser.log");
    let child = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu"])
        // WebGL by the processor.
        .arg("--enable-unsafe-swiftshader")
        .args(["--disable-dev-shm-usage", "--no-first-run"])
        .args(["--enable-logging=stderr", "--v=0"])
        .arg(format!("--window-size={size}"))
        .arg(format!(
            "--user-data-dir={}",
            folder.join("profile").display()
        ))
        .arg(format!("file://{}", page.display()))
        .stdout(Stdio::null())
        .stderr(File::create(&log).unwrap())
        .spawn()
        .unwrap();
    let mut browser = Browser(child);
    let patience = Instant::now() + Duration::from_mins(2);
    loop {
        let said = fs::read(&log).unwrap();
        let said = String::from_utf8_lossy(&said);
        if let Some((_, report)) = said.split_once("selftest ")
            && let Some((report, _)) = report.split_once(" selftest-end")
        {
            return report.to_owned();
        }
        let ended = browser.0.try_wait().unwrap();
        assert!(
            ended.is_none() && Instant::now() < patience,
            "the test did not end: {ended:?}\n{said}"
        );
        sleep(Duration::from_millis(50));
    }
}

/// A page with a script that works it as a user would, in `harness.js`, which has what users
/// need. Errors are collected from the beginning, in `pageErrors`, and the user comes last.
pub fn with_user(page: &str, user: &str) -> String {
    let collect = "<script nonce='user'>globalThis.pageErrors = [];\
        addEventListener('error', (event) => pageErrors.push(event.message));\
        addEventListener('unhandledrejection', (event) => pageErrors.push(String(event.reason)));\
        console.error = (...all) => pageErrors.push(all.join(' '));</script>";
    let user = include_str!("harness.js").replacen("USER", user, 1);
    // The page's own script runs if it is the one that the page's policy names, the user's because of this.
    let page = page.replacen("script-src ", "script-src 'nonce-user' ", 1);
    let page = page.replacen("<style>", &format!("{collect}<style>"), 1);
    let (before, after) = page.rsplit_once("</body>").unwrap();
    format!("{before}<script nonce='user'>\n{user}</script>\n</body>{after}")
}
