"""The pages that are made of tables of measurements: one module a page. `bench/make_pages.py` writes them."""
