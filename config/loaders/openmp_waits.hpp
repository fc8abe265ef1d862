#pragma once

namespace stillmap {

/// Lets OpenMP's threads, on which oneDNN runs, sleep some microseconds after they began to wait
/// for each other. As they are, they spin for milliseconds: beside other programs that takes the
/// time of the very thread that is waited for, and a scan several times as long. libgomp reads this
/// from the environment (GOMP_SPINCOUNT) once, before main: the program starts itself again with
/// it, so this is to be called first. Does nothing where the environment says how to wait, and
/// where the program cannot be started again.
void shorten_openmp_waits(char** argv);

}  // namespace stillmap
