"""Write a sweep as a static site: a page of all fits, a page per material, and tables for further analysis."""
