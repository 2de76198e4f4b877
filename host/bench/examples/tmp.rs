#[path = "../tests/support/mod.rs"]
mod support;
fn main() {
    let t = std::time::Instant::now();
    let big = std::env::args().nth(1).is_some();
    let shape = support::Shape::default();
    let names: Vec<String> = (0..12).map(|i| format!("Planner number {i}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let shape = if big { support::Shape { planners: &names, scenarios: 700, anytime: false, ..shape } } else { shape };
    let rows = support::rows(&shape, 1);
    let t = std::time::Instant::now();
    let n = rows.len();
    let report = fleetyard_bench::report::Report::new(fleetyard_bench::report::Subject {
        title: "random-and-rooms".into(), facts: vec![("store".into(), "x.sqlite".into())], ..Default::default()
    }, &rows);
    eprintln!("evaluated {:?}", t.elapsed());
    let page = report.html();
    std::fs::write("/tmp/report/report.md", report.markdown(Some("figures"), &[])).unwrap();
    std::fs::create_dir_all("/tmp/report/figures").unwrap();
    for figure in report.figures() { std::fs::write(format!("/tmp/report/figures/{}.svg", figure.id), fleetyard_bench::report::svg(&figure)).unwrap(); }
    eprintln!("{n} rows, {} bytes, {:?}", page.len(), t.elapsed());
    print!("{page}");
}
