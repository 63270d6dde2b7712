"""How good a fit is: metrics, the split, reopening, the verdict, comparisons, charts and the atlas of failures."""
