# `make deb`: Debian packages of the installation's components.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME stillmap)
set(CPACK_PACKAGE_CONTACT "Stillmap contributors <stillmap@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_STRIP_FILES ON)
# Installs as for the real root, so that the server's configuration goes to /etc.
set(CPACK_SET_DESTDIR ON)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_COMPONENTS_ALL data server tools)
if(TARGET stillmap_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION misc)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)

set(same_version "stillmap-data (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_DATA_PACKAGE_NAME stillmap-data)
set(CPACK_DEBIAN_DATA_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_DATA_PACKAGE_SHLIBDEPS OFF)
set(CPACK_COMPONENT_DATA_DESCRIPTION
  "Data: two networks (street; kitti, CC BY-NC-SA 4.0), descriptions of lidars, robots and networks, the ROS 2 package.")

set(CPACK_DEBIAN_SERVER_PACKAGE_NAME stillmap-server)
set(CPACK_DEBIAN_SERVER_PACKAGE_DEPENDS "${same_version}")
set(CPACK_DEBIAN_SERVER_PACKAGE_RECOMMENDS stillmap)
set(CPACK_DEBIAN_SERVER_PACKAGE_CONTROL_EXTRA
  ${CMAKE_CURRENT_LIST_DIR}/conffiles ${CMAKE_CURRENT_LIST_DIR}/postinst
  ${CMAKE_CURRENT_LIST_DIR}/prerm ${CMAKE_CURRENT_LIST_DIR}/postrm)
set(CPACK_COMPONENT_SERVER_DESCRIPTION
  "The server: scans on DDS in; poses, a static labelled map and answers to planners out.")

set(CPACK_DEBIAN_TOOLS_PACKAGE_NAME stillmap)
set(CPACK_DEBIAN_TOOLS_PACKAGE_DEPENDS "${same_version}")
set(CPACK_DEBIAN_TOOLS_PACKAGE_SUGGESTS stillmap-server)
set(CPACK_COMPONENT_TOOLS_DESCRIPTION
  "The command line: replays recordings, asks for maps, plans paths, simulates a city.")
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-stillmap)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
# The module is built for one version of Python.
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
  "${same_version}, python3-numpy, python3 (>= ${STILLMAP_PYTHON_VERSION}), python3 (<< ${STILLMAP_PYTHON_NEXT_VERSION})")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "stillmap, python3-matplotlib")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION
  "The Python module: map files, recordings, the mapper and servers, as NumPy arrays.")
include(CPack)
