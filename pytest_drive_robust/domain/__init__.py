"""Pure, frozen data that every other part of the package speaks. Imports nothing but the standard library at run time."""
