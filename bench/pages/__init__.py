"""Pages generated from tables of measurements, one module per page. `bench/make_pages.py` writes them."""
