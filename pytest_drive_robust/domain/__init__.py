"""Pure, frozen data that every other part of the package speaks. Imports only the standard library."""
