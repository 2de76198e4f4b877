// A report: tables and figures of the trials that pass the filters. All trials are in
// `data`, see columns.rs; nothing is loaded.

import { bytesOf } from './base64.js';
import { $ } from './dom.js';
import { digits, fixed, minus, percent, plain, scientific } from './numbers.js';

const data = JSON.parse($('data').textContent);
$('data').remove();
const count = data.rows;
