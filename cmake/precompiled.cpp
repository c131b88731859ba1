// The code of targets that hold only precompiled headers (module.cmake).
int main() { return 0; }
