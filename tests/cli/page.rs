//! A report as a page: one file that asks nobody for anything, the same bytes for every
//! configuration, and shown by a browser without complaint.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use crate::support::command::{done, ended, pointmill};

/// Bytes of a page at most.
const LARGEST: usize = 3_000_000;

/// Reduces a made-up scan with a page; returns it.
fn page(at: &Path, arguments: &[&str]) -> String {
    let all = [&["reduce", "scan.laz", "-o", "thin.laz", "--report", "page.html"], arguments];
    let (code, _, told) = pointmill(at, &all.concat());
    assert!([0, 3].contains(&code), "{told}");
    fs::read_to_string(at.join("page.html")).unwrap()
}

fn scan(points: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    done(folder.path(), &["synth", "als", "-n", points, "-o", "scan.laz"]);
    folder
}

#[test]
fn a_page_is_one_file_that_says_what_a_report_says() {
    let folder = scan("40000");
    let html = page(folder.path(), &["--keep", "10%", "--accept", "max <= 1e-6, kept >= 1"]);
    assert!(html.len() < LARGEST, "{} bytes", html.len());
    for told in [
        "scan.laz: reduction report",
        ">FAIL<",
        "<code>max &#60;= 1e-6</code>",
        "does not hold",
        "40,000",
        "From above",
        "From the south",
        "Where it is off",
        "Where points were kept",
        "Where every point went",
        "By class",
        "What was not measured",
        "The baseline is what a voxel grid of as many points would have left",
        "<polyline",
        "thin.laz",
        "SHA-256 <code>",
        "<code>pointmill reproduce thin.laz</code>",
    ] {
        assert!(html.contains(told), "{told}");
    }
    assert!(!html.contains("A voxel grid of as many points: it is"), "it was measured");
    assert!(!html.contains("Pictures:") && !html.contains("Pictures of"), "all was drawn");
    let places = html.matches(" high</figcaption>").count();
    assert!((2..=10).contains(&places) && html.contains(&format!("The worst {places} places")));
    // 2 views, 2 maps, and each place twice.
    assert_eq!(html.matches("src=\"data:image/png;base64,").count(), 2 + 2 + 2 * places);
}

#[test]
fn a_page_asks_for_nothing() {
    let folder = scan("5000");
    let html = page(folder.path(), &["--keep", "10%", "--no-provenance"]);
    assert!(html.contains("Hashes of the inputs and outputs: outputs do not note"));
    assert!(!html.contains("SHA-256") && !html.contains("pointmill reproduce"));
    assert!(html.contains("content=\"default-src 'none'; img-src data:;"));
    for (begin, end) in [("src=\"", '"'), ("href=\"", '"'), ("url(", ')')] {
        for asked in html.split(begin).skip(1).filter_map(|rest| rest.split(end).next()) {
            assert!(asked.starts_with("data:"), "{asked}");
        }
    }
    for never in ["http:", "https:", "<script", "<link", "<iframe", "@import", " onload"] {
        assert!(!html.contains(never), "{never}");
    }
}

#[test]
fn a_page_has_the_same_bytes_for_every_configuration() {
    let folder = scan("30000");
    let at = folder.path();
    let first = page(at, &["--keep", "5%", "--threads", "1"]);
    let second = page(at, &["--keep", "5%", "--threads", "3", "--memory", "300MiB"]);
    assert!(first == second, "the pages differ");
    let third = page(at, &["--keep", "5.1%"]);
    assert!(first != third, "another reduction has another page");
}

#[test]
fn names_and_texts_of_files_stand_in_a_page_as_text() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let name = "<b>&\"x.laz";
    done(at, &["synth", "plane", "-n", "1000", "-o", name]);
    done(at, &["reduce", name, "-o", "o.laz", "--keep", "10%", "--report", "p.html", "-q"]);
    let html = fs::read_to_string(at.join("p.html")).unwrap();
    assert!(!html.contains("<b>&\"x") && html.contains("&#60;b&#62;&#38;&#34;x.laz"), "escaped");
}

#[test]
fn what_was_not_measured_or_drawn_is_said() {
    let folder = scan("3000");
    let at = folder.path();
    done(at, &["convert", "scan.laz", "-o", "o.las", "--report", "p.html"]);
    let html = fs::read_to_string(at.join("p.html")).unwrap();
    assert!(html.contains("a pipeline that streams has no tiles"));
    assert!(html.contains("nobody gave rules by which it is accepted"));
    let line = "read scan.laz ! normals ! grid side=2 ! discard";
    let (code, _, told) = pointmill(at, &["run", line, "--report", "p.html"]);
    assert_eq!(code, 0, "{told}");
    let html = fs::read_to_string(at.join("p.html")).unwrap();
    assert!(html.contains("Pictures of what was written: it is in no file."));
    assert!(html.contains("From above"), "the scan is drawn all the same");
}

/// A browser that shows a page in the folder `at`, with `how` besides; what it says on stderr and
/// prints.
fn browse(at: &Path, how: &[&str]) -> (String, String) {
    let mut browser = Command::new("chromium");
    browser.current_dir(at);
    browser.args([
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--hide-scrollbars",
        "--enable-logging=stderr",
        "--v=0",
    ]);
    browser.arg(format!("--user-data-dir={}", at.join("profile").display()));
    let address = format!("file://{}", at.join("page.html").display());
    browser.args(how).arg(address);
    let output = ended(browser, Duration::from_secs(120));
    assert!(output.status.success(), "{output:?}");
    let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stderr), text(&output.stdout))
}

/// The colours of a picture, and the part of its pixels that are not white.
fn colors(png: &Path) -> (BTreeSet<[u8; 3]>, f64) {
    let file = std::io::BufReader::new(fs::File::open(png).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    let channels = info.color_type.samples();
    let all = pixels.chunks_exact(channels).map(|pixel| [pixel[0], pixel[1], pixel[2]]);
    let (colors, count) = (all.clone().collect(), all.len());
    (colors, all.filter(|pixel| *pixel != [255; 3]).count() as f64 / count as f64)
}

#[test]
#[ignore = "needs the browser chromium"]
fn a_browser_shows_a_page_and_has_nothing_to_complain_of() {
    let folder = scan("50000");
    let at = folder.path();
    let html = page(at, &["--keep", "10%", "--accept", "max <= 5, lossless"]);
    assert!(html.contains(">PASS<"));
    let shot = at.join("shot.png");
    let net = at.join("net.json");
    let how = [
        "--window-size=1000,5200".to_owned(),
        format!("--screenshot={}", shot.display()),
        format!("--log-net-log={}", net.display()),
    ];
    let (told, _) = browse(at, &how.each_ref().map(String::as_str));
    assert!(!told.contains("CONSOLE"), "{told}");
    let (colors, filled) = colors(&shot);
    assert!(colors.len() > 1000 && filled > 0.2, "{} colours, {filled}", colors.len());
    let asked = fs::read_to_string(net).unwrap();
    assert!(asked.contains("\"constants\""), "the browser wrote what it asked for");
    // What it asks its maker for it asks without a page, too.
    let urls = asked.split("\"url\":\"").skip(1).filter_map(|rest| rest.split('"').next());
    let of_its_maker =
        |url: &&str| url.contains(".google.com/") || url.contains("//update.googleapis.com/");
    let urls = urls.filter(|url| url.starts_with("http") && !of_its_maker(url));
    assert_eq!(urls.collect::<Vec<_>>(), Vec::<&str>::new(), "the page asked for something");
    let (told, dom) = browse(at, &["--dump-dom"]);
    assert!(!told.contains("CONSOLE"), "{told}");
    assert!(dom.contains("What was not measured") && dom.contains("</footer>"));
}
