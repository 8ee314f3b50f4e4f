// What ThreadSanitizer passes over in this test's own process; thread_sanitizer.supp says why.

extern "C" const char* __tsan_default_suppressions() { return "deadlock:libgdal\n"; }
