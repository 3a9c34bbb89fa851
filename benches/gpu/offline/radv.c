// Compiles SPIR-V of compute programs with the first Vulkan device, and prints what the driver tells of each:
//   radv FILE.spv…   →   FILE.spv<TAB>statistic<TAB>value
//   radv --times FILE.spv…   →   FILE.spv<TAB>cold or cached<TAB>milliseconds
// Cold: what it takes to make a pipeline. Cached: to make it from data that a pipeline cache gave, as a later launch does.
// With Mesa's driver for AMD and RADV_FORCE_FAMILY=navi21 no card is needed. Programs bind storage buffers 0 to 7.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <vulkan/vulkan.h>

enum { BUFFERS = 8, MOST = 64 };

static void check(VkResult result, const char* what) {
    if (result == VK_SUCCESS) return;
    fprintf(stderr, "%s: Vulkan's error %d\n", what, result);
    exit(1);
}

static uint32_t* read_words(const char* path, size_t* bytes) {
    FILE* file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END)) {
        perror(path);
        exit(1);
    }
    *bytes = (size_t)ftell(file);
    rewind(file);
    uint32_t* words = malloc(*bytes);
    if (!words || fread(words, 1, *bytes, file) != *bytes) exit(1);
    fclose(file);
    return words;
}

static VkDevice open_device(void) {
    VkApplicationInfo application = {VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_2};
    VkInstanceCreateInfo instance_info = {VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO, .pApplicationInfo = &application};
    VkInstance instance;
    check(vkCreateInstance(&instance_info, NULL, &instance), "vkCreateInstance");
    VkPhysicalDevice physical;
    uint32_t count = 1;
    VkResult found = vkEnumeratePhysicalDevices(instance, &count, &physical);
    if (count == 0 || (found != VK_SUCCESS && found != VK_INCOMPLETE)) {
        fprintf(stderr, "no Vulkan device\n");
        exit(1);
    }
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(physical, &properties);
    fprintf(stderr, "%s\n", properties.deviceName);
    float priority = 1;
    VkDeviceQueueCreateInfo queue = {
        VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, .queueCount = 1, .pQueuePriorities = &priority};
    VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR feature = {
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_EXECUTABLE_PROPERTIES_FEATURES_KHR, .pipelineExecutableInfo = VK_TRUE};
    const char* extension = VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME;
    VkDeviceCreateInfo device_info = {VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                                      .pNext = &feature,
                                      .queueCreateInfoCount = 1,
                                      .pQueueCreateInfos = &queue,
                                      .enabledExtensionCount = 1,
                                      .ppEnabledExtensionNames = &extension};
    VkDevice device;
    check(vkCreateDevice(physical, &device_info, NULL, &device), "vkCreateDevice");
    return device;
}

static VkPipelineLayout make_layout(VkDevice device) {
    VkDescriptorSetLayoutBinding bindings[BUFFERS];
    for (uint32_t k = 0; k < BUFFERS; k++)
        bindings[k] = (VkDescriptorSetLayoutBinding){
            k, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, NULL};
    VkDescriptorSetLayoutCreateInfo set_info = {VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO,
                                                .bindingCount = BUFFERS,
                                                .pBindings = bindings};
    VkDescriptorSetLayout set;
    check(vkCreateDescriptorSetLayout(device, &set_info, NULL, &set), "vkCreateDescriptorSetLayout");
    VkPipelineLayoutCreateInfo layout_info = {
        VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, .setLayoutCount = 1, .pSetLayouts = &set};
    VkPipelineLayout layout;
    check(vkCreatePipelineLayout(device, &layout_info, NULL, &layout), "vkCreatePipelineLayout");
    return layout;
}

static void print_statistics(VkDevice device, VkPipeline pipeline, const char* path) {
    PFN_vkGetPipelineExecutablePropertiesKHR properties =
        (PFN_vkGetPipelineExecutablePropertiesKHR)vkGetDeviceProcAddr(device, "vkGetPipelineExecutablePropertiesKHR");
    PFN_vkGetPipelineExecutableStatisticsKHR statistics =
        (PFN_vkGetPipelineExecutableStatisticsKHR)vkGetDeviceProcAddr(device, "vkGetPipelineExecutableStatisticsKHR");
    VkPipelineInfoKHR info = {VK_STRUCTURE_TYPE_PIPELINE_INFO_KHR, .pipeline = pipeline};
    VkPipelineExecutablePropertiesKHR executable = {VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_PROPERTIES_KHR};
    uint32_t count = 1;
    VkResult found = properties(device, &info, &count, &executable);
    if (found != VK_INCOMPLETE) check(found, "vkGetPipelineExecutablePropertiesKHR");
    printf("%s\tSubgroup size\t%u\n", path, executable.subgroupSize);
    VkPipelineExecutableInfoKHR first = {VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_INFO_KHR, .pipeline = pipeline};
    VkPipelineExecutableStatisticKHR all[MOST];
    for (int k = 0; k < MOST; k++)
        all[k] = (VkPipelineExecutableStatisticKHR){VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_STATISTIC_KHR};
    count = MOST;
    check(statistics(device, &first, &count, all), "vkGetPipelineExecutableStatisticsKHR");
    for (uint32_t k = 0; k < count; k++)
        printf("%s\t%s\t%llu\n", path, all[k].name, (unsigned long long)all[k].value.u64);
}

static VkPipeline make_pipeline(VkDevice device, VkPipelineLayout layout, VkPipelineCache cache,
                                VkPipelineCreateFlags flags, const char* path) {
    size_t bytes;
    uint32_t* words = read_words(path, &bytes);
    VkShaderModuleCreateInfo module_info = {
        VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, .codeSize = bytes, .pCode = words};
    VkShaderModule module;
    check(vkCreateShaderModule(device, &module_info, NULL, &module), path);
    VkComputePipelineCreateInfo pipeline_info = {VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO,
                                                 .flags = flags,
                                                 .stage = {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                                                           .stage = VK_SHADER_STAGE_COMPUTE_BIT,
                                                           .module = module,
                                                           .pName = "main"},
                                                 .layout = layout};
    VkPipeline pipeline;
    check(vkCreateComputePipelines(device, cache, 1, &pipeline_info, NULL, &pipeline), path);
    vkDestroyShaderModule(device, module, NULL);
    free(words);
    return pipeline;
}

static VkPipelineCache make_cache(VkDevice device, const void* data, size_t bytes) {
    VkPipelineCacheCreateInfo info = {
        VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO, .initialDataSize = bytes, .pInitialData = data};
    VkPipelineCache cache;
    check(vkCreatePipelineCache(device, &info, NULL, &cache), "vkCreatePipelineCache");
    return cache;
}

static double milliseconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1e3 + now.tv_nsec * 1e-6;
}

static void* print_time(VkDevice device, VkPipelineLayout layout, const char* path, const char* kind, void* data,
                        size_t* bytes) {
    double start = milliseconds();
    VkPipelineCache cache = make_cache(device, data, *bytes);
    VkPipeline pipeline = make_pipeline(device, layout, cache, 0, path);
    printf("%s\t%s\t%.1f\n", path, kind, milliseconds() - start);
    free(data);
    check(vkGetPipelineCacheData(device, cache, bytes, NULL), "vkGetPipelineCacheData");
    data = malloc(*bytes);
    check(vkGetPipelineCacheData(device, cache, bytes, data), "vkGetPipelineCacheData");
    vkDestroyPipeline(device, pipeline, NULL);
    vkDestroyPipelineCache(device, cache, NULL);
    return data;
}

int main(int count, char** paths) {
    int times = count > 1 && strcmp(paths[1], "--times") == 0;
    VkDevice device = open_device();
    VkPipelineLayout layout = make_layout(device);
    for (int k = 1 + times; k < count; k++) {
        if (times) {
            size_t bytes = 0;
            void* data = print_time(device, layout, paths[k], "cold", NULL, &bytes);
            free(print_time(device, layout, paths[k], "cached", data, &bytes));
            continue;
        }
        VkPipeline pipeline = make_pipeline(
            device, layout, VK_NULL_HANDLE, VK_PIPELINE_CREATE_CAPTURE_STATISTICS_BIT_KHR, paths[k]);
        print_statistics(device, pipeline, paths[k]);
        vkDestroyPipeline(device, pipeline, NULL);
    }
}
