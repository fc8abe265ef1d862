#pragma once

#include <pybind11/pybind11.h>

namespace stillmap::python {

// Each adds its classes and functions to the module; a class before those that speak of it.
void bind_frames(pybind11::module_& module);
void bind_dataset(pybind11::module_& module);
void bind_traversability(pybind11::module_& module);
void bind_map(pybind11::module_& module);
void bind_mapper(pybind11::module_& module);
void bind_client(pybind11::module_& module);
void bind_evaluation(pybind11::module_& module);

}  // namespace stillmap::python
