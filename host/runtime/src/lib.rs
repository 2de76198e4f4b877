//! Loads and supervises plugins under budgets.
