"""What makes the documentation site of the pages in docs/, the declarations of the commands and the docstrings."""
