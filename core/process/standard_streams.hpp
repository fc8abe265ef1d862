#pragma once

namespace stillmap {

/// Opens those of standard input, output and error that a program was started without (`2>&-`).
/// Else the first files that it opens take their numbers, and what is printed is written into them.
/// Before any file is opened. Reading gives nothing, printing fails as it would without, and what
/// goes to standard error is lost.
void open_missing_standard_streams();

}  // namespace stillmap
