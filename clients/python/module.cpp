#include "clients/python/bindings.hpp"

PYBIND11_MODULE(_stillmap, module) {
  namespace python = stillmap::python;
  module.attr("__version__") = STILLMAP_VERSION;
  python::bind_frames(module);
  python::bind_dataset(module);
  python::bind_traversability(module);
  python::bind_map(module);
  python::bind_mapper(module);
  python::bind_client(module);
  python::bind_evaluation(module);
}
