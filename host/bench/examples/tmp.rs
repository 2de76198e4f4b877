#[path = "../tests/support/mod.rs"]
mod support;
fn main() {
    let big = std::env::args().nth(1).is_some();
    let shape = support::Shape::default();
    let names: Vec<String> = (0..12).map(|i| format!("Planner number {i}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let shape = if big { support::Shape { planners: &names, scenarios: 700, anytime: false, ..shape } } else { shape };
    let rows = support::rows(&shape, 1);
    let t = std::time::Instant::now();
    let n = rows.len();
    let page = fleetyard_bench::report::render_html(&fleetyard_bench::report::Report {
        title: "random-and-rooms".into(), story: vec!["4 planners on 60 instances: LaCAM* is first.".into()],
        rows, planners: shape.planners.iter().map(|s| s.to_string()).collect(), ranking: "text".into(), ..Default::default()
    });
    eprintln!("{n} rows, {} bytes, {:?}", page.len(), t.elapsed());
    print!("{page}");
}
