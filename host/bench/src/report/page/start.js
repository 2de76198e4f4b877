// A report: tables and figures of the trials that pass the filters. All trials are in
// `data`, see columns.rs; nothing is loaded.
'use strict';
(() => {
const $ = (id) => document.getElementById(id);
const data = JSON.parse($('data').textContent);
$('data').remove();
const count = data.rows;
