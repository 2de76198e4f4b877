//! Reports.

mod columns;
mod figure;
mod figures;
mod format;
mod page;
mod palette;
mod svg;

use crate::Row;

/// What a report says.
#[derive(Debug, Default)]
pub struct Report {
    pub title: String,
    pub story: Vec<String>,
    pub caveats: Vec<String>,
    pub methods: Vec<String>,
    pub facts: Vec<(String, String)>,
    pub texts: Vec<(String, String)>,
    pub rows: Vec<Row>,
    pub planners: Vec<String>,
    pub ranking: String,
}

pub use svg::svg;
/// 
pub fn render_html(report: &Report) -> String {
    page::html(report)
}
