"""A sweep as a static site: a page of all fits, a page a material, tables to go on with."""
