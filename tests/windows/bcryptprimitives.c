/* What Rust's standard library takes random numbers from. Wine has this library from version 9 on. */
#include <windows.h>

BOOLEAN NTAPI SystemFunction036(PVOID data, ULONG bytes);

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE data, SIZE_T bytes)
{
    return SystemFunction036(data, (ULONG)bytes);
}
